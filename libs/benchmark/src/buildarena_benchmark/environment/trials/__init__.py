"""Trials of machines on a task: one, many over processes, and the programs that drive them."""
