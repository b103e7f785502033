"""The ledger of our own numbers: what the documents state, what makes it, and faults that must be noticed."""
