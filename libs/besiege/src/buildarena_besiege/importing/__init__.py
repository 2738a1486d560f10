"""Reads the game's machine files (.bsg), our own and anybody's."""
