"""Every rule: one call of the function that ``params.call`` names, with the arguments of ``params.arguments``."""

import gc
import importlib
import typing
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

# Imports make a million objects that stay, and matplotlib as many that go: a tenth of a stage was looking for garbage.
gc.set_threshold(50_000)

from towval.commands.console import Outcome, errors_reported, show  # noqa: E402  # not before the line above


def call(name: str, arguments: Mapping[str, Any]) -> Outcome | None:
    """Call ``module:function``; texts become paths where the function's annotations ask for them."""
    module, _, function_name = name.partition(":")
    # What is imported stays: nobody need look for garbage in it, least of all the process as it ends.
    gc.disable()
    function: Callable[..., Outcome | None] = getattr(importlib.import_module(module), function_name)
    gc.freeze()
    gc.enable()
    wanted = typing.get_type_hints(function)
    return function(**{key: _converted(value, wanted[key]) for key, value in arguments.items()})


def _converted(value: Any, wanted: Any) -> Any:
    if wanted in (Path, Path | None) and value is not None:
        return Path(value)
    if wanted == Sequence[Path]:
        return [Path(item) for item in value]
    if wanted == Mapping[str, Path]:
        return {key: Path(item) for key, item in value.items()}
    return value


if TYPE_CHECKING:
    from snakemake.script import Snakemake

    snakemake: Snakemake

if __name__ == "__main__":
    with errors_reported(Path(snakemake.log[0])):
        outcome = call(snakemake.params.call, snakemake.params.arguments)
        if outcome is not None:
            show(outcome)
