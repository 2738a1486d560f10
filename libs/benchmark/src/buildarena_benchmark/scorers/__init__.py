"""Scorers: from a machine and its trajectory to a verdict; pure, and blind to the simulator."""
