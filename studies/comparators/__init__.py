"""Other programs and methods to measure ours against, each in one place."""
