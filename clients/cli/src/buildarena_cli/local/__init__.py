"""Postgres and Valkey from PyPI wheels, run as children on loopback, data in a project folder."""
