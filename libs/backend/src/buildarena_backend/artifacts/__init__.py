"""Artifacts: the store of large results, references to them, and garbage collection."""
