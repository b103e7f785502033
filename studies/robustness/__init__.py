"""Faults on purpose: damaged campaigns and files, killed runs, hostile surroundings; and what becomes of them."""
