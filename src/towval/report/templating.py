"""Templates of the pages, and the package's own style sheets and scripts."""

import re
from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from towval.model.findings import FINDINGS

PAGE_MARK = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"
"""What a page that may be replaced says near its beginning: the policy of our pages."""

_CODE = re.compile(r"\b[a-z]+(?:_[a-z]+)+\b")
_UNCERTAINTY = re.compile(r"\bu_(num|input|D|val)\b")


def template_environment() -> Environment:
    """The templates; every text of a campaign is escaped, and a missing value is an error."""
    environment = Environment(
        loader=PackageLoader("towval.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["symbols"] = _symbols
    return environment


def _symbols(text: str) -> Markup:
    """A text with ``u_val`` and the like as symbols with a subscript, and codes of findings as plain words."""
    text = _CODE.sub(lambda code: code[0].replace("_", " ") if code[0] in FINDINGS else code[0], text)
    return Markup(_UNCERTAINTY.sub(r"<i>u</i><sub>\1</sub>", str(escape(text))))


def template_asset(name: str) -> Markup:
    """A style sheet or script of the package; never data, so it is inserted without escaping."""
    return Markup((files("towval.report") / "templates" / name).read_text(encoding="utf-8"))
