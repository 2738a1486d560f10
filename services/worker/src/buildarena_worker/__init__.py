"""Construction sessions: workflows, model requests, journal, built-in models."""
