"""The tow in three dimensions: inclined tether, heights, slope, feet, anisotropy, regions of the floor, sticking.

Loads and friction shift the pressure under the footprint at every instant, and the pressure decides the friction. The
two are solved together (``pressure``), exactly, with the wrench of three basis pressures from one pass over the
footprint's boundary (``unit_wrenches``). docs/physics.md derives it. Where every effect is off,
:mod:`towval.physics.motion` computes the same faster.
"""
