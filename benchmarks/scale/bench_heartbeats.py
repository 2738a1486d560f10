"""What heartbeats cost Postgres: log, processor time, and which of them changed an index.

A hundredth of what is planned for is measured: one construct worker of 200 sessions, whose jobs
have costs, beside as many that wait and ended. `planned` multiplies it. Run by
`make bench-heartbeats`.
"""

import argparse
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any, Final

from benchmarks.figures import tell
from benchmarks.sizing.costs import cpu_s
from sqlalchemy import text

from buildarena_cli.local import EmbeddedPostgres
from buildarena_store import Database, JobKey, Lease, NewJob, Store, open_store

SESSIONS: Final = 200
"""Of one worker; it renews all their leases in one statement."""
ROUNDS: Final = 400
WORKERS_PLANNED: Final = 100
BEATS_PER_LEASE: Final = 4
LEASE_S: Final = 10.0
FORMER_LOG: Final = 4500.0
"""Bytes that a heartbeat wrote while the end of a lease stood in the job's row."""
CHANGED: Final = text(
    "SELECT pg_stat_get_tuples_updated(oid), pg_stat_get_tuples_hot_updated(oid) "
    "FROM pg_class WHERE relname = 'leases'"
)


def main() -> None:
    """Prints the figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, help="also write the figures here")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="buildarena-bench-") as folder:
        postgres = EmbeddedPostgres(Path(folder) / "pg", Path(folder) / "pg.log", durable=True)
        process = postgres.start()
        try:
            database = Database(postgres.url)
            database.migrate()
            figures = _measured(open_store(database, lease_s=LEASE_S, max_faults=8), process.pid)
            database.close()
        finally:
            postgres.stop(process)
    tell(figures, arguments.json)


def _measured(store: Store, server: int) -> dict[str, Any]:
    held = _filled(store)
    _ask(store, "CHECKPOINT")
    for _ in range(20):
        store.leases.heartbeat(held)
    log, used_s, taken = _log_bytes(store), cpu_s(server), []
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        renewed = store.leases.heartbeat(held)
        taken.append(1000 * (time.perf_counter() - begun))
        if len(renewed) != len(held):
            raise SystemExit("a lease was lost")
    heartbeats = ROUNDS * len(held)
    log_bytes = (_log_bytes(store) - log) / heartbeats
    cpu_ms = 1000 * (cpu_s(server) - used_s) / heartbeats
    time.sleep(1.5)  # until the server has added up
    _ask(store, "SELECT pg_stat_force_next_flush()")
    changed, in_place = _ask(store, CHANGED)
    per_s = WORKERS_PLANNED * SESSIONS * BEATS_PER_LEASE / LEASE_S
    return {
        "heartbeats": heartbeats,
        "log_bytes_each": round(log_bytes, 1),
        "log_bytes_bar": 900,
        "ratio_to_before": round(log_bytes / FORMER_LOG, 3),
        "postgres_cpu_ms_each": round(cpu_ms, 4),
        "without_index_share": in_place / changed,
        "statement_of_200_ms": round(statistics.median(taken), 2),
        "planned": {
            "workers": WORKERS_PLANNED,
            "sessions_each": SESSIONS,
            "lease_s": LEASE_S,
            "heartbeats_per_s": per_s,
            "postgres_cores": round(per_s * cpu_ms / 1000, 2),
            "log_mb_per_s": round(per_s * log_bytes / 1e6, 2),
        },
    }


def _filled(store: Store) -> list[Lease]:
    """Jobs of which one worker has as many leases as it has sessions."""
    made = [
        NewJob(
            key=JobKey(task="t", task_version="1", model_hash="m", track="track", seed=seed),
            model="m",
            model_config={"name": "m"},
            track_config={"workflow": "single"},
        )
        for seed in range(3 * SESSIONS)
    ]
    with store.database.transaction() as connection:
        store.jobs.add(made, connection=connection)
    held = [store.leases.claim("construct", owner="construct@host:1") for _ in range(SESSIONS)]
    _ask(store, "UPDATE jobs SET cost_usd = 0.25, requests = 3 WHERE true RETURNING 1")
    return [lease for lease in held if lease is not None]


def _ask(store: Store, query: Any) -> Any:
    statement = text(query) if isinstance(query, str) else query
    with store.database.statement() as connection:
        answer = connection.execute(statement)
        return answer.first() if answer.returns_rows else None


def _log_bytes(store: Store) -> float:
    (at,) = _ask(store, "SELECT pg_current_wal_insert_lsn() - '0/0'::pg_lsn")
    return float(at)


if __name__ == "__main__":
    main()
