"""What the game is given: machine files, the scripts in them, and levels."""
