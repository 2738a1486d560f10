"""The PyBullet engine."""

LIBRARY = "pybullet"
