"""Simulators: whatever runs a machine in a task's trial, behind one protocol."""
