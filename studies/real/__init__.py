"""Studies on measured data outside the repository: each skips, with the reason, where the data is absent."""
