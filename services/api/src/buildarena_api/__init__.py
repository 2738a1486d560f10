"""The REST API of BuildArena."""
