"""The MuJoCo engine."""

LIBRARY = "mujoco"
