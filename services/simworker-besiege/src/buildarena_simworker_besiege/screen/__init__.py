"""A game with a window: hands, eyes, and the steps that are only done when they were seen."""
