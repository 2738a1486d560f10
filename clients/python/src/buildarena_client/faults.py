"""How a transport says that no answer came: the same words for both."""

from __future__ import annotations


class WireError(Exception):
    """No whole answer came."""


class NoConnectionError(WireError):
    """There was no connection: nothing was carried out."""


class BrokenError(WireError):
    """The connection broke off: what was sent may have been carried out."""


class SilentError(WireError):
    """Nothing came in time."""


class GarbledError(WireError):
    """What came is not HTTP."""
