"""Stage handlers that run simulators."""
