"""The paper's own studies, its figures, and the ledger of its claims."""
