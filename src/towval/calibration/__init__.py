"""Calibration of the ceiling camera and the floor under it, from pictures of a board."""
