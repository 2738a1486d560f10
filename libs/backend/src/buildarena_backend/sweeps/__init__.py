"""Sweeps and their life cycle."""
