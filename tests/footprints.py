"""Footprints for the physics tests."""

from studies.worlds.footprints import random_star
from towval.model import Patch

__all__ = ["random_star", "rectangle"]


def rectangle(width, depth):
    x, y = width / 2, depth / 2
    return Patch([[-x, -y], [x, -y], [x, y], [-x, y]])
