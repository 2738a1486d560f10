"""The layers that every request passes: access, limits, logs, problems, caching."""
