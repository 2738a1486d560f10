"""Families: tasks that are sampled by each job's seed."""
