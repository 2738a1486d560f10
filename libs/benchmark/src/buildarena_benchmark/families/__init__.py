"""Families: tasks of which each job's seed draws one."""
