"""The paper's figures 2 to 8 from our own numbers: each function returns a matplotlib ``Figure`` and writes no file."""
