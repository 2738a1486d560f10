"""Shared library of the service's processes: jobs from submission to score, and their records.

Postgres is the truth about jobs; the artifact store keeps the large results by content hash.
Messages are only hints: a lost message, a doubled message or a dead worker loses nothing, as the
reaper notifies workers again of what waits too long. Rows leave this package as frozen dataclasses,
never as database objects.
"""

from importlib.metadata import version

__version__ = version("buildarena-backend")
