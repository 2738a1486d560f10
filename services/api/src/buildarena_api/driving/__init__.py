"""Drives: a machine simulated at the speed of the clock, in a process apart, by somebody's keys."""
