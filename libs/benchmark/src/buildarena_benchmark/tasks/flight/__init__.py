"""Gliders, and machines that hold heights."""
