"""Metrics of the whole service, for monitoring: read from what the jobs say, so never lost."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import ARRAY, ColumnElement, Connection, Double, Row, case, cast, func, select, text

from buildarena_backend import events
from buildarena_backend.database.database import Database
from buildarena_backend.database.tables import attempts, jobs, sweeps, verifications
from buildarena_backend.states import Audit, JobState, Outcome, SweepState, Verdict

HIDDEN: Final = "hidden"
"""Of connections of other logins, whose state only members of pg_read_all_stats see."""
CONNECTION_STATES: Final = (
    "active",
    "idle",
    "idle in transaction",
    "idle in transaction (aborted)",
    HIDDEN,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ServerFigures:
    """The database, and the server that it is on.

    Attributes:
        size_bytes: The database's size on disk.
        connections: Connections to it, by their state; those that nothing is in are 0.
        server_connections: Connections to all databases of the server.
        server_connections_limit: How many the server takes.
        oldest_transaction_s: For how long the oldest open transaction has been open, of those whose
            start this login may see; 0 when none is.
        transaction_age: Transactions since the oldest row that is not frozen; the server stops
            before it is 2**31.
        committed: Transactions of the database that were committed, since its statistics began.
        rolled_back: Those that were undone.
        deadlocks: Those that were undone because they waited for each other.
        rows: Live rows by table, as the server estimates them.
        dead_rows: Rows by table that no transaction needs and that were not removed yet, likewise.
    """

    size_bytes: int
    connections: Mapping[str, int]
    server_connections: int
    server_connections_limit: int
    oldest_transaction_s: float
    transaction_age: int
    committed: int
    rolled_back: int
    deadlocks: int
    rows: Mapping[str, int]
    dead_rows: Mapping[str, int]


def read_server(connection: Connection) -> ServerFigures:
    """Return the figures of the server that a connection leads to."""
    database = connection.execute(_DATABASE).one()
    states = {row.state: int(row.connections) for row in connection.execute(_CONNECTIONS)}
    tables = connection.execute(_TABLES).all()
    return ServerFigures(
        size_bytes=database.size_bytes,
        connections=dict.fromkeys(CONNECTION_STATES, 0) | states,
        server_connections=database.server_connections,
        server_connections_limit=database.server_connections_limit,
        oldest_transaction_s=float(database.oldest_transaction_s),
        transaction_age=database.transaction_age,
        committed=database.xact_commit,
        rolled_back=database.xact_rollback,
        deadlocks=database.deadlocks,
        rows={row.relname: row.n_live_tup for row in tables},
        dead_rows={row.relname: row.n_dead_tup for row in tables},
    )


_DATABASE: Final = text(
    """
    SELECT pg_database_size(datid) AS size_bytes, xact_commit, xact_rollback, deadlocks,
        (SELECT sum(numbackends)::int FROM pg_stat_database) AS server_connections,
        current_setting('max_connections')::int AS server_connections_limit,
        (SELECT age(datfrozenxid) FROM pg_database WHERE oid = datid) AS transaction_age,
        (SELECT COALESCE(GREATEST(extract(epoch FROM clock_timestamp() - min(xact_start)), 0), 0)
            FROM pg_stat_activity AS other
            WHERE other.datid = mine.datid AND pid <> pg_backend_pid()) AS oldest_transaction_s
    FROM pg_stat_database AS mine WHERE datname = current_database()
    """
)
_CONNECTIONS: Final = text(
    f"""
    SELECT COALESCE(state, '{HIDDEN}') AS state, count(*) AS connections FROM pg_stat_activity
    WHERE datname = current_database()
        AND COALESCE(backend_type, 'client backend') = 'client backend'
    GROUP BY 1
    """  # noqa: S608 - made of our own words
)
_TABLES: Final = text(
    "SELECT relname, n_live_tup, n_dead_tup FROM pg_stat_user_tables WHERE schemaname = 'public'"
)


STAGE_SECONDS = (0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60, 120, 300, 600, 1800, 3600)
"""Bounds of the classes of stage durations, in seconds; each class has its lower bound in it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricValues:
    """All of them, from one moment.

    Attributes:
        jobs: Jobs by state, stage, outcome and reason of their error; empty where there is none.
        queues: How many ``jobs`` wait in each ``queue``, and for how long the oldest has.
        models: What the sessions of each model used: requests, tokens and dollars.
        stages: How long attempts took, by stage and result: how many are in each class of
            STAGE_SECONDS, and in the last those above all, and the sum of their seconds.
        sweeps: Sweeps by state.
        running: Jobs that are worked on, by queue.
        verifications: Ended verifications by verdict.
        audits: Jobs by where their audit stands; those that need none are left out.
        server: The Postgres server's own.
    """

    jobs: Mapping[tuple[str, str, str, str], int]
    queues: Sequence[Row[Any]]
    models: Mapping[str, Mapping[str, Any]]
    stages: Mapping[tuple[str, str], tuple[Sequence[int], float]]
    sweeps: dict[str, int]
    running: dict[str, int]
    verifications: dict[str, int]
    audits: dict[str, int]
    server: ServerFigures


class Metrics:
    """Reads the service's figures; each read counts over all jobs, so callers cache the result."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def read(self) -> MetricValues:
        """Return all figures."""
        with self._database.transaction() as connection:
            connection.execute(text("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY"))
            places, used, audits = _count_jobs(connection)
            return MetricValues(
                jobs=places,
                queues=_queues(connection),
                models=used,
                stages=_stages(connection),
                sweeps=dict.fromkeys(map(str, SweepState), 0)
                | _counted(connection, sweeps.c.state),
                running=_counted(connection, jobs.c.queue, jobs.c.state == JobState.RUNNING),
                verifications=dict.fromkeys(map(str, Verdict), 0)
                | _counted(
                    connection, verifications.c.verdict, verifications.c.verdict.is_not(None)
                ),
                audits=audits,
                server=read_server(connection),
            )


def _count_jobs(
    connection: Connection,
) -> tuple[Counter[tuple[str, str, str, str]], dict[str, Counter[str]], Counter[str]]:
    """Return jobs by stage, use by model and jobs by audit, by one query."""
    place = (
        jobs.c.state,
        jobs.c.stage,
        func.coalesce(jobs.c.outcome, "").label("outcome"),
        case((jobs.c.outcome == Outcome.ERRORED, func.coalesce(jobs.c.reason, "")), else_="").label(
            "reason"
        ),
    )
    use = [jobs.c[name] for name in ("requests", "input_tokens", "output_tokens", "cost_usd")]
    columns = (*place, jobs.c.model, jobs.c.audit)
    query = select(
        *columns, func.count().label("jobs"), *(func.sum(one).label(one.name) for one in use)
    ).group_by(*columns)
    places: Counter[tuple[str, str, str, str]] = Counter()
    audits: Counter[str] = Counter(dict.fromkeys(map(str, Audit), 0))
    used: dict[str, Counter[str]] = {}
    for row in connection.execute(query):
        places[row.state, row.stage, row.outcome, row.reason] += row.jobs
        used.setdefault(row.model, Counter()).update({c.name: getattr(row, c.name) for c in use})
        if row.audit is not None:
            audits[row.audit] += row.jobs
    return places, used, audits


def _queues(connection: Connection) -> Sequence[Row[Any]]:
    waited = func.extract("epoch", events.now - func.min(jobs.c.available_at))
    query = (
        select(
            jobs.c.queue,
            func.count().label("jobs"),
            cast(func.greatest(waited, 0), Double).label("oldest_s"),
        )
        .where(jobs.c.state == JobState.QUEUED)
        .group_by(jobs.c.queue)
        .order_by(jobs.c.queue)
    )
    return connection.execute(query).all()


def _stages(connection: Connection) -> dict[tuple[str, str], tuple[list[int], float]]:
    seconds = func.extract("epoch", attempts.c.ended_at - attempts.c.started_at)
    columns = (
        attempts.c.stage,
        attempts.c.result,
        func.width_bucket(
            cast(seconds, Double), cast([*map(float, STAGE_SECONDS)], ARRAY(Double))
        ).label("bucket"),
    )
    query = (
        select(*columns, func.count().label("attempts"), func.sum(seconds).label("seconds"))
        .where(attempts.c.ended_at.is_not(None))
        .group_by(*columns)
    )
    found: dict[tuple[str, str], tuple[list[int], float]] = {}
    for row in connection.execute(query):
        counts, total = found.get((row.stage, row.result), ([0] * (len(STAGE_SECONDS) + 1), 0.0))
        counts[row.bucket] += row.attempts
        found[row.stage, row.result] = (counts, total + float(row.seconds))
    return found


def _counted(
    connection: Connection, column: ColumnElement[str], *conditions: ColumnElement[bool]
) -> dict[str, int]:
    query = select(column, func.count()).where(*conditions).group_by(column)
    return {row[0]: row[1] for row in connection.execute(query)}
