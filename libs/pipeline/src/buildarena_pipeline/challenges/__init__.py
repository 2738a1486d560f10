"""Challenges: seasons as data, the packages that people hand in, their checks and scores."""
