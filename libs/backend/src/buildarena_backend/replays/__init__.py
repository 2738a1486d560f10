"""Replays of construction: the stored actions repeated chapter by chapter."""
