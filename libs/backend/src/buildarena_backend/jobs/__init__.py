"""Jobs: how they are added, found, changed, and what came of them."""
