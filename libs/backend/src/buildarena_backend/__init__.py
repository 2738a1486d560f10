"""What the service's processes share: jobs from a submission to a score, and what is kept of them.

Postgres is the truth about jobs; the artifact store keeps the large results by content hash.
Messages are only hints: a lost message, a doubled message or a dead worker loses nothing, as the
reaper notifies workers again of what waits too long. Rows leave this package as frozen dataclasses,
never as database objects.
"""

from importlib.metadata import version

__version__ = version("buildarena-backend")
