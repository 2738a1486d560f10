"""Conversion of the game's logs to trajectories: this package's lines, and published CSV."""
