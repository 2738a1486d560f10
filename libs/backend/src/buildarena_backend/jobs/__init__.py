"""Jobs: how they are added, found and changed, and their results."""
