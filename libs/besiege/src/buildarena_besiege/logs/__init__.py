"""From what the game logs to trajectories: our scripts' lines, published CSV, a headless game's."""
