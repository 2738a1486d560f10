"""Why no answer came: the same errors for both transports."""

from __future__ import annotations


class TransportError(Exception):
    """No whole answer came."""


class NoConnectionError(TransportError):
    """There was no connection: nothing was carried out."""


class BrokenError(TransportError):
    """The connection broke off: what was sent may have been carried out."""


class SilentError(TransportError):
    """Nothing came in time."""


class GarbledError(TransportError):
    """What came is not HTTP."""


def text_of(error: Exception) -> str:
    """What an error says, or its name if it says nothing."""
    return str(error) or type(error).__name__
