"""The road of a job: its stages and leases, the queues, submissions, and the embedded servers.

Postgres is the truth; messages only say "look at this job". A lost message, a doubled message
or a dead worker therefore loses nothing: the sweeper announces again what waits too long.
"""

__version__ = "0.1.0"
