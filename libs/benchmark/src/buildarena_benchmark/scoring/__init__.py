"""Scoring of trials: the scorer interface, shared measures, and shared scorers."""
