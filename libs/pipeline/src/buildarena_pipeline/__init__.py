"""The life cycle of a job: what can be submitted, its stages and leases, and the queues.

Postgres is the truth; messages are only hints. A lost message, a doubled message or a dead worker
therefore loses nothing: the reaper notifies workers again of what waits too long.
"""

from importlib.metadata import version

__version__ = version("buildarena-pipeline")
