"""A game with a window: input, capture, and steps that count as done only when seen."""
