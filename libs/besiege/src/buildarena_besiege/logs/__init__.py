"""From what the game logs to trajectories: our scripts' lines, and published CSV."""
