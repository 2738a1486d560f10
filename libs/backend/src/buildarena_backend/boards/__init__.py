"""Inputs of leaderboards: cells with their tallies, single trials, and the log of changes."""
