"""The game as a simulator: a runner that loads machines into Besiege and reads its log."""
