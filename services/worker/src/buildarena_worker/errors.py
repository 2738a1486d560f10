"""Errors that an operator's workflow may raise."""

from buildarena_worker.session.results import ConstructionFailedError

__all__ = ["ConstructionFailedError"]
