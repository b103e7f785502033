"""Maps of stability: where methods are right, flagged or silently wrong."""
