"""Vehicles that carry cargo to a point, and back."""
