"""Tasks: what must be built, how it is tried and how it is scored."""
