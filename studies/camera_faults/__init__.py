"""Faults of real cameras, planted into footage whose truth is known, and how each ends."""
