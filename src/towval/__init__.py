"""towval: how well a simulation of a towed object agrees with what a camera saw.

The stages are modules of the package (``towval.calibration.calibrate``, ``towval.tracking.track``, …): types in, types
out. Files are read and written in ``towval.io`` alone. Nothing is imported here, so that a stage's results depend on
that stage's modules and on nothing else.
"""

__version__ = "0.1.0"
