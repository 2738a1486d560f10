"""The statement that claims a job: a recovered one first, then the oldest.

It is one statement, because every stage of every job waits for it. The distinct owners of a queue
are found in steps along the index, one probe each, however many jobs an owner has.
"""

from __future__ import annotations

from sqlalchemy import Boolean, column, text

from buildarena_backend.jobs.job import JOB_COLUMNS
from buildarena_backend.leases.misses import MISSED_LATELY
from buildarena_backend.states import JobState

OPERATOR = ""
"""Who owns the jobs that no API key submitted."""

LEFT_ALONE = "1 day"
"""How long programs of 1.0.0rc1, which know the column of `jobs` only, leave a lease alone."""

_OWNER = "COALESCE(owner, '')"
_QUEUED = f"state = '{JobState.QUEUED}' AND queue = :queue"
_WAITS = f"{_QUEUED} AND available_at <= clock_timestamp()"
_ROOM = (
    f"{_OWNER} <> ALL(CAST(:full AS text[]))"
    f" AND (CAST(:only AS text[]) IS NULL OR {_OWNER} = ANY(CAST(:only AS text[])))"
    " AND (CAST(:version AS text) IS NULL OR track_config ->> 'simulation_version' = :version)"
    f" AND (CAST(:prefix AS text) IS NULL OR NOT EXISTS ({MISSED_LATELY}))"
)
CLAIM = text(
    f"""
    WITH RECURSIVE owners (name) AS (
        (SELECT {_OWNER} FROM jobs WHERE {_QUEUED} ORDER BY {_OWNER} LIMIT 1)
        UNION ALL
        SELECT (
            SELECT {_OWNER} FROM jobs WHERE {_QUEUED} AND {_OWNER} > owners.name
            ORDER BY {_OWNER} LIMIT 1
        ) FROM owners WHERE owners.name IS NOT NULL
    ), turns AS MATERIALIZED (
        SELECT name FROM owners
        WHERE name IS NOT NULL AND name <> ALL(CAST(:full AS text[]))
            AND (CAST(:only AS text[]) IS NULL OR name = ANY(CAST(:only AS text[])))
            AND (CAST(:version AS text) IS NULL OR EXISTS (
                SELECT FROM jobs WHERE {_WAITS} AND {_OWNER} = name
                AND track_config ->> 'simulation_version' = :version
            ))
        ORDER BY
            name IS NOT DISTINCT FROM CAST(:last AS text),
            name < COALESCE(CAST(:last AS text), ''),
            name
    ), taken AS (
        UPDATE jobs SET
            state = '{JobState.RUNNING}',
            lease_owner = :owner,
            lease_token = lease_token + 1,
            lease_expires_at = clock_timestamp() + interval '{LEFT_ALONE}',
            started_at = COALESCE(started_at, clock_timestamp())
        WHERE id = COALESCE(
            (SELECT id FROM jobs WHERE {_WAITS} AND faults > 0 AND {_ROOM}
             ORDER BY created_at, id LIMIT 1 FOR UPDATE SKIP LOCKED),
            (SELECT oldest.id FROM turns CROSS JOIN LATERAL (
                SELECT id FROM jobs WHERE {_WAITS} AND {_OWNER} = turns.name AND {_ROOM}
                ORDER BY created_at, id LIMIT 1 FOR UPDATE SKIP LOCKED
             ) AS oldest LIMIT 1)
        )
        RETURNING *
    ), leased AS (
        INSERT INTO leases (job_id, token, expires_at)
        SELECT id, lease_token, clock_timestamp() + :duration FROM taken
        ON CONFLICT (job_id) DO UPDATE SET token = excluded.token, expires_at = excluded.expires_at
    ), attempted AS (
        INSERT INTO attempts (job_id, token, stage, worker)
        SELECT id, lease_token, stage, lease_owner FROM taken
    ), recorded AS (
        INSERT INTO events (job_id, kind, data)
        SELECT id, state, jsonb_build_object('stage', stage, 'worker', lease_owner) FROM taken
    )
    SELECT {", ".join(column.name for column in JOB_COLUMNS)},
        EXISTS (SELECT 1 FROM budgets WHERE budgets.id IN (payer, owner)) AS budgeted
    FROM taken
    """  # noqa: S608 - made of our own column names
).columns(*JOB_COLUMNS, column("budgeted", Boolean))
"""Takes a job of ``:queue`` for ``:owner``, and returns it with whether a budget pays for it.

Owners in ``:full`` are passed over, and all but those in ``:only`` if it is given, as are jobs for
another version of the simulator than ``:version`` if it is given, and those that the key of the
runners whose names begin with ``:prefix`` missed lately; the owner in ``:last`` comes after the
others, but for its recovered jobs.
"""

# In steps along the index, one probe for each queue, however many jobs it has.
WAITING_QUEUES = text(
    f"""
    WITH RECURSIVE queues (name) AS (
        (SELECT queue FROM jobs WHERE state = '{JobState.QUEUED}' ORDER BY queue LIMIT 1)
        UNION ALL
        SELECT (SELECT queue FROM jobs WHERE state = '{JobState.QUEUED}' AND queue > queues.name
            ORDER BY queue LIMIT 1) FROM queues WHERE queues.name IS NOT NULL
    )
    SELECT name, (
        SELECT count(*) FROM (
            SELECT FROM jobs WHERE state = '{JobState.QUEUED}' AND queue = queues.name
                AND available_at <= clock_timestamp() LIMIT :most
        ) AS waiting
    ) AS jobs
    FROM queues WHERE name IS NOT NULL
    """  # noqa: S608 - made of our own names
)
