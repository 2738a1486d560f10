"""Backups: a dump of the database and the artifacts that it refers to, and the way back."""
