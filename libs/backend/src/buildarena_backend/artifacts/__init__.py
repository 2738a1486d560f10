"""Artifacts: the store of large results, which of them anything refers to, and what goes."""
