"""Machines for the game Besiege: machine files, scripts and levels out, files and logs in."""
