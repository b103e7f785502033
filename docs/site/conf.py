"""How the documentation becomes a site that opens offline: ``make docs``. The pages are those of docs/."""

import re
from pathlib import Path

import towval

project = "towval"
author = "The towval developers"
release = towval.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
exclude_patterns = ["site"]
html_theme = "furo"
html_title = "towval"
html_show_sphinx = False
html_show_copyright = False
html_static_path = ["static"]
html_css_files = ["tables.css"]

autosummary_generate = True
autodoc_default_options = {"members": True, "show-inheritance": True}
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
napoleon_google_docstring = False
napoleon_use_rtype = False

myst_heading_anchors = 3
myst_enable_extensions = ["colon_fence"]
nb_execution_mode = "force"
nb_execution_timeout = 600
nb_execution_raise_on_error = True
nb_merge_streams = True
# Drawings in Mermaid stay text; roles of docstrings name what is not on the site.
suppress_warnings = ["misc.highlighting_failure", "myst.xref_missing", "ref.python", "docutils"]

REPOSITORY = "https://github.com/towval/towval/blob/main"


def outside(_app, _docname, source):
    """Links from the pages to files of the repository lead to where it is published."""
    source[0] = re.sub(r"\]\(\.\./", f"]({REPOSITORY}/", source[0])


def setup(app):
    """Register what is done to each page."""
    app.connect("source-read", outside)
    pages = Path(app.srcdir)
    assert (pages / "architecture.md").is_file(), "build from docs/: make docs"
