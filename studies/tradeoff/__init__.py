"""Charts of error against cost."""
