"""Errors that the library raises for a caller's faults. A model's fault is a `Refused` value."""


class GeometryError(ValueError):
    """Base of everything the library raises."""


class CatalogueError(GeometryError):
    """A module file breaks the format; the message names the entry and what is allowed."""


class DocumentError(GeometryError):
    """A machine document is not a machine; the message names the entry and what is allowed."""


class SequenceError(GeometryError):
    """Input of the replay command is not a list of actions; the message names the entry."""
