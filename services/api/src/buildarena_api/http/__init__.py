"""What every request passes: access, limits, logs, problems, caching."""
