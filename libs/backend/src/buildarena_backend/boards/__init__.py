"""What leaderboards are made of: cells with their tallies, single trials, and why they changed."""
