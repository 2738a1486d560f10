"""What must be true when all links are up again, and what it took."""

import json
import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from scenarios.chaos.accounts import wrongs
from sqlalchemy import Connection, text
from support.player import Player
from support.providers.stand_in import ProviderStandIn

from buildarena_benchmark import builtin_tasks, score
from buildarena_geometry.machine_files import machine_bytes
from buildarena_simulation import simulate
from buildarena_store import Database

PAID_MODEL = "standin/expert"
BUILT_IN = "builtin/expert"
"""What plays behind the stand-in's wire."""
EVENTS = (
    *("api_unreachable", "heartbeat_failed", "lease_lost", "consumer_stalled"),
    *("broker_unreachable", "reaper_failed", "lease_over", "gave_up"),
)
"""Lines of logs that are counted."""


def paid_twice(database: Database, standin: ProviderStandIn) -> tuple[int, int]:
    """Answers that no journal has, and the most that there may be.

    A session has one request open at a time. Its answer is lost where the session's lease was: one
    for each attempt that did not come to its end.
    """
    with database.transaction() as connection:
        journalled = connection.execute(
            text("SELECT count(*) FROM journal JOIN jobs ON jobs.id = job_id WHERE model = :m"),
            {"m": PAID_MODEL},
        ).scalar_one()
        broken = connection.execute(
            text(
                "SELECT count(*) FROM attempts JOIN jobs ON jobs.id = job_id WHERE model = :m "
                "AND attempts.stage = 'construct' AND result <> 'done'"
            ),
            {"m": PAID_MODEL},
        ).scalar_one()
    return standin.counts.answered - journalled, broken


def differences(database: Database, task_name: str, engine: str) -> tuple[int, list[str]]:
    """Compares every job with a session and a trial that nobody disturbed.

    Returns:
        How many were compared, and those with other requests, machines or figures.
    """
    play, task = Player(), builtin_tasks()[task_name]
    query = (
        "SELECT jobs.id, seed, model, requests, indicator, success, (SELECT machine_hash FROM "
        "rollouts WHERE job_id = jobs.id LIMIT 1) AS machine FROM jobs ORDER BY id"
    )
    with database.transaction() as connection:
        rows = connection.execute(text(query)).all()
    found: list[str] = []
    known: dict[bytes, Any] = {}
    for row in rows:
        model = BUILT_IN if row.model == PAID_MODEL else row.model
        played = play(model, task=task_name, seed=row.seed)
        if row.requests != len(played.entries):
            found.append(f"{row.id}: {row.requests} requests, undisturbed {len(played.entries)}")
        if played.suspended is None:
            continue
        made = played.suspended
        machine = machine_bytes(made.machine)
        if machine not in known:
            trajectory = simulate(made.machine, task.scenario, engine, controls=made.controls)
            known[machine] = score(task, made.machine, trajectory)
        fresh = known[machine]
        if (row.indicator, row.success) != (fresh.indicator, fresh.success):
            found.append(f"{row.id}: {row.indicator}, undisturbed {fresh.indicator}")
    return len(rows), found


def figures(database: Database, logs: Path) -> dict[str, Any]:
    """What happened, in numbers."""
    with database.transaction() as connection:
        return {
            "jobs": _counted(connection, "SELECT outcome, count(*) FROM jobs GROUP BY 1"),
            "requests_journalled": connection.execute(
                text("SELECT count(*) FROM journal")
            ).scalar_one(),
            "attempts": _counted(
                connection,
                "SELECT stage || ' by ' || regexp_replace(worker, '[:-][0-9.]+$', '') || ': ' "
                "|| result, count(*) FROM attempts GROUP BY 1",
            ),
            "faults": _counted(
                connection,
                "SELECT left(detail, 60), count(*) FROM attempts WHERE result NOT IN "
                "('done', 'suspended') AND detail IS NOT NULL GROUP BY 1 ORDER BY 2 DESC LIMIT 30",
            ),
            "database_connections": dict(
                connection.execute(
                    text(
                        "SELECT sessions AS made, sessions_abandoned AS abandoned "
                        "FROM pg_stat_database WHERE datname = current_database()"
                    )
                )
                .one()
                ._mapping
            ),
            "log_lines": log_lines(logs),
        }


def log_lines(logs: Path) -> dict[str, dict[str, int]]:
    """How often each host's log has each of the events that tell of a cut."""
    return {
        file.stem: dict(Counter(_events(file.read_text(errors="replace").splitlines())))
        for file in sorted(logs.glob("*.log"))
    }


def tracebacks(logs: Path) -> dict[str, int]:
    """How often each host's log has something that nobody foresaw."""
    found = {
        file.stem: len(re.findall(r"Traceback \(most recent", file.read_text(errors="replace")))
        for file in sorted(logs.glob("*.log"))
    }
    return {host: number for host, number in found.items() if number}


def _events(lines: Iterable[str]) -> Iterable[str]:
    for line in lines:
        try:
            event = json.loads(line).get("event")
        except (ValueError, AttributeError):
            continue
        if event in EVENTS:
            yield event


def _counted(connection: Connection, query: str) -> dict[str, int]:
    return {str(name): int(number) for name, number in connection.execute(text(query))}


__all__ = ["differences", "figures", "paid_twice", "tracebacks", "wrongs"]
