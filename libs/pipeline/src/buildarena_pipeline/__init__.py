"""The life cycle of a job: what can be submitted, its stages and leases, and the queues.

Postgres is the truth; messages are only hints. A lost message, a doubled message or a dead worker
therefore loses nothing: the reaper notifies workers again of what waits too long.
"""

__version__ = "1.0.0rc1"
