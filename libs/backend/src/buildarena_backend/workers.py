"""The register of workers: their queues and last reports."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, Final

from sqlalchemy import Row, bindparam, cast, delete, func, not_, select, tuple_
from sqlalchemy.dialects.postgresql import Insert, insert
from sqlalchemy.types import DateTime, Double

from buildarena_backend import events
from buildarena_backend.database.database import Database
from buildarena_backend.database.tables import workers

FORGOTTEN_AFTER = timedelta(hours=1)
WORST_CLOCKS: Final = 10
ANNOUNCED: Final = ("simulation", "kind", "deterministic")
MAX_ANNOUNCEMENTS: Final = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkerCounts:
    """Summary of the register of workers, whose size is bounded.

    Attributes:
        serving: Workers alive, by the queue they serve.
        lost: Workers that went silent without signing off and are not forgotten, by kind.
        peak_memory_bytes: The most memory that one alive ever had, by kind.
        clocks: Ids of workers alive whose clocks differ most from the database's, and by how many
            seconds they are ahead; the worst first.
    """

    serving: Mapping[str, int]
    alive: Mapping[str, int]
    lost: Mapping[str, int]
    peak_memory_bytes: Mapping[str, int]
    clocks: Sequence[tuple[str, float]]


class Workers:
    """The register of workers."""

    def __init__(self, database: Database, *, alive_for_s: float = 15.0) -> None:
        self._database = database
        self._alive_for = timedelta(seconds=alive_for_s)

    def report(
        self,
        *,
        worker_id: str,
        kind: str,
        queues: Sequence[str],
        host: str,
        pid: int,
        versions: Mapping[str, Any],
        peak_memory_bytes: int | None = None,
        reported_at: datetime | None = None,
    ) -> None:
        """Report that a worker is alive; forget those that have not reported for an hour."""
        parameters = {
            "id": worker_id,
            "kind": kind,
            "queues": list(queues),
            "host": host,
            "pid": pid,
            "versions": dict(versions),
            "peak_memory_bytes": peak_memory_bytes,
            "reported_at": reported_at,
        }
        self._database.run(_REPORT, parameters)

    def leave(self, worker_id: str) -> bool:
        """Remove a worker that shuts down from the register; return whether it was there."""
        return self._database.run(delete(workers).where(workers.c.id == worker_id)) > 0

    def forget_ended(self, host: str, is_running: Callable[[int], bool]) -> None:
        """Remove a host's killed workers, so that none of them is reported as missing.

        Args:
            is_running: Whether a process of that host runs, by its id.
        """
        ours = select(workers.c.id, workers.c.pid).where(workers.c.host == host)
        with self._database.transaction() as connection:
            ended = [row.id for row in connection.execute(ours) if not is_running(row.pid)]
            connection.execute(delete(workers).where(workers.c.id.in_(ended)))

    def trim(self, prefix: str, *, limit: int) -> None:
        """Forget all workers with ids of this prefix except those that reported last."""
        ours = select(workers.c.id).where(func.starts_with(workers.c.id, prefix))
        old = ours.order_by(workers.c.last_heartbeat_at.desc()).offset(limit)
        self._database.run(delete(workers).where(workers.c.id.in_(old)))

    def page(self, *, limit: int, after: tuple[datetime, str] | None = None) -> Sequence[Row[Any]]:
        """Return known workers, the last started first: an order that reports do not change.

        Rows have also whether the worker is ``alive``: whether it reported within the last 15
        seconds, by the database's clock.

        Args:
            after: Start and id of the worker behind which the page begins.
        """
        alive = (workers.c.last_heartbeat_at > events.now - self._alive_for).label("alive")
        query = select(workers, alive).order_by(workers.c.started_at.desc(), workers.c.id.desc())
        if after is not None:
            query = query.where(tuple_(workers.c.started_at, workers.c.id) < tuple_(*after))
        return self._database.all_rows(query.limit(limit))

    def counts(self) -> WorkerCounts:
        """Return a summary of the register; no worker's versions are read."""
        alive = workers.c.last_heartbeat_at > events.now - self._alive_for
        kinds = select(
            workers.c.kind,
            func.count().filter(alive).label("alive"),
            func.count().filter(not_(alive)).label("lost"),
            func.max(workers.c.peak_memory_bytes).filter(alive).label("peak"),
        ).group_by(workers.c.kind)
        queues = select(func.jsonb_array_elements_text(workers.c.queues).label("queue"))
        queue = queues.where(alive).subquery().c.queue
        serving = select(queue, func.count().label("alive")).group_by(queue)
        clocks = (
            select(workers.c.id, workers.c.clock_skew_s)
            .where(alive, workers.c.clock_skew_s.is_not(None))
            .order_by(func.abs(workers.c.clock_skew_s).desc())
            .limit(WORST_CLOCKS)
        )
        with self._database.transaction() as connection:
            by_kind = list(connection.execute(kinds))
            return WorkerCounts(
                serving={row.queue: row.alive for row in connection.execute(serving)},
                alive={row.kind: row.alive for row in by_kind if row.alive},
                lost={row.kind: row.lost for row in by_kind},
                peak_memory_bytes={row.kind: row.peak for row in by_kind if row.peak is not None},
                clocks=[(row.id, row.clock_skew_s) for row in connection.execute(clocks)],
            )

    def announcements(self) -> Sequence[Row[Any]]:
        """Return the distinct announcements of the known workers."""
        versions = workers.c.versions
        query = (
            select(workers.c.queues, *(versions[name].label(name) for name in ANNOUNCED))
            .where(workers.c.kind == "simulate")
            .distinct()
            .limit(MAX_ANNOUNCEMENTS)
        )
        return self._database.all_rows(query)


def _report() -> Insert:
    """Write a worker's row and forget silent ones; made once, as it is executed often."""
    named = ("id", "kind", "queues", "host", "pid", "versions", "peak_memory_bytes")
    row: dict[str, Any] = {name: bindparam(name, type_=workers.c[name].type) for name in named}
    reported_at = bindparam("reported_at", type_=DateTime(timezone=True))
    row["clock_skew_s"] = cast(func.extract("epoch", reported_at - events.now), Double)
    silent = delete(workers).where(
        workers.c.last_heartbeat_at < events.now - FORGOTTEN_AFTER, workers.c.id != row["id"]
    )
    statement = insert(workers).values(row)
    renewed = {name: statement.excluded[name] for name in row if name != "id"}
    return statement.on_conflict_do_update(
        index_elements=["id"], set_={**renewed, "last_heartbeat_at": events.now}
    ).add_cte(silent.cte("forgotten"))


_REPORT: Final = _report()
