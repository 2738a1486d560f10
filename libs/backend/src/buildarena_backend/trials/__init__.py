"""Trials of a job: simulators, stored trajectories, scoring, and checks of uploads."""
