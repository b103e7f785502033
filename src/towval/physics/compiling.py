"""How this package compiles its inner loops.

Compiled code is kept on disk beside the sources (or in the user's cache, where those cannot be written), so that
only the first call after installing compiles. Divisions follow IEEE 754 instead of raising, for a check at each
would cost more than the division; products and sums may be contracted to one rounding. No other liberties are taken
with arithmetic.
"""

from __future__ import annotations

import functools

from numba import njit

compiled = functools.partial(njit, cache=True, error_model="numpy", fastmath={"contract"})
"""Decorator factory: use as ``@compiled()``."""
