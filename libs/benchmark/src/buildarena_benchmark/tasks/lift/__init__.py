"""Rockets: thrust over weight, height, and a payload."""
