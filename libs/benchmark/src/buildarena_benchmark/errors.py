"""Errors of the benchmark room."""


class BenchmarkError(Exception):
    """Base of every error this room raises."""


class TaskError(BenchmarkError, ValueError):
    """A task file is wrong; the message names line, field and valid choices."""
