"""Import of the game's machine files (.bsg), written by this package or any other program."""
