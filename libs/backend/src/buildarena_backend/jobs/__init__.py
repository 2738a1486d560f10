"""Jobs: their creation, search, transitions and results."""
