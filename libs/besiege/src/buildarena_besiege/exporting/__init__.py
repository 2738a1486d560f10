"""Files for the game: machine files, the scripts in them, and levels."""
