"""Synthetic scenes with ground truth: what is filmed, how it moved, and the pictures of it.

Of what is measured it shares the camera model alone; the motion of the towed object is computed without the physics.
"""
