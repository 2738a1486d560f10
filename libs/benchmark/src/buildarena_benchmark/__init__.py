"""Tasks, scorers, statistics and leaderboard mathematics of BuildArena."""
