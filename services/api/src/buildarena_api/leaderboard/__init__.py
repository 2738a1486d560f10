"""The leaderboard in memory: cache, filters, views."""
