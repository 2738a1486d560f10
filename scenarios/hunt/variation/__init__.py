"""Machines that are varied: action logs that still build something when they are changed."""
