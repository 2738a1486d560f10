"""Pictures and films of trials, drawn in software so that they need no display (extra: video)."""
