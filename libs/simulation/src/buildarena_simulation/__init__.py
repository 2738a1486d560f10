"""Simulate a machine in a scenario: structure loads, breaking, PyBullet and MuJoCo engines."""
