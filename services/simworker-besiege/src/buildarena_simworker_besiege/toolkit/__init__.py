"""The game played by the command line of BuildArena 2.0's toolkit, in place of its window."""
