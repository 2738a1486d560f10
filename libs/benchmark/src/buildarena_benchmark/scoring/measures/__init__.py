"""Measurements shared by several scorers: support forces, connectivity, wheel travel."""
