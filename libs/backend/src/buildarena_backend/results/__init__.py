"""Scores of jobs, and who has verified or must still audit them."""
