"""The first evening with a game: every step of the registry is played, and packed as evidence."""

from buildarena_simworker_besiege.first_evening.evening import first_evening

__all__ = ["first_evening"]
