"""towval: how well a simulation of a towed object agrees with what a camera saw.

The stages are modules of the package (``towval.calibration.calibrate``, ``towval.tracking.track``, …): types in, types
out. Files are read and written in ``towval.io`` alone. Nothing is imported here, so that a stage's results depend on
that stage's modules and on nothing else; :func:`load` reads results as pandas tables.
"""

import importlib
from typing import Any

__version__ = "0.1.0"


def load(*folders: Any) -> Any:
    """Results of campaigns as pandas tables, :class:`towval.io.frames.Results`; see :func:`towval.io.frames.load`."""
    # By name, so that no stage depends on what reads results.
    return importlib.import_module("towval.io.frames").load(*folders)
