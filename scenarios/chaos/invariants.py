"""What the database must say after injected faults, in queries: each returns what is wrong."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from scenarios.chaos.faults import WORKERS, Kill
from sqlalchemy import text

from buildarena_backend.database.database import Database
from buildarena_backend.results.verifications import ABANDONED_AFTER

WRONG = {
    "jobs that have not ended": "SELECT id FROM jobs WHERE state <> 'done'",
    "jobs that ended without a score": (
        "SELECT id FROM jobs WHERE outcome IN ('errored', 'cancelled') OR success IS NULL"
    ),
    "jobs that ended more than once": (
        # A refuted one has its trial again.
        "SELECT job_id FROM events GROUP BY job_id HAVING count(*) FILTER (WHERE kind = 'done') "
        "> 1 + count(*) FILTER (WHERE kind = 'refuted')"
    ),
    "jobs that entered the leaderboard more than once, or changed there": (
        # What a runner brought enters once it was verified.
        "SELECT job_id FROM board_changes b JOIN jobs ON jobs.id = b.job_id GROUP BY job_id "
        "HAVING count(*) FILTER (WHERE kind = 'entered') <> 1 "
        "OR bool_or(kind <> 'entered' AND NOT (kind = 'unscored' AND ran_on_runner))"
    ),
    "jobs by runners that were not verified": (
        "SELECT id FROM jobs WHERE ran_on_runner AND audit IS DISTINCT FROM 'verified'"
    ),
    "journal entries written without a hold": (
        "SELECT j.job_id FROM journal j LEFT JOIN attempts a USING (job_id, token) "
        "WHERE a.job_id IS NULL OR j.created_at < a.started_at "
        "OR j.created_at > COALESCE(a.ended_at, 'infinity')"
    ),
    "holds of one job at the same time": (
        "SELECT a.job_id FROM attempts a JOIN attempts b USING (job_id) "
        "WHERE a.token < b.token AND COALESCE(a.ended_at, 'infinity') > b.started_at"
    ),
    "journals with a gap or a double entry": (
        "SELECT job_id FROM journal GROUP BY job_id "
        "HAVING count(*) <> max(sequence) + 1 OR count(*) <> count(DISTINCT sequence)"
    ),
    "jobs whose account is not their journal's": (
        "SELECT id FROM jobs WHERE (requests, input_tokens, output_tokens, cost_usd) <> "
        "(SELECT count(*), COALESCE(sum(input_tokens), 0), COALESCE(sum(output_tokens), 0), "
        "COALESCE(sum(cost_usd), 0) FROM journal WHERE job_id = jobs.id)"
    ),
    "budgets that spent less than was journalled at their expense": (
        "SELECT id FROM budgets WHERE spent_requests < "
        "(SELECT count(*) FROM journal WHERE payer = budgets.id)"
    ),
    "finished rollouts that are not those asked for": (
        "SELECT job_id FROM rollouts WHERE finished_at IS NULL OR success IS NULL"
    ),
    "reservations left over": "SELECT job_id FROM reservations",
}


def audited(database: Database) -> bool:
    """Whether no verification is open; those of killed workers are others' from now on."""
    with database.transaction() as connection:
        connection.execute(
            text("UPDATE verifications SET claimed_at = claimed_at - interval '1 second' * :later"),
            {"later": ABANDONED_AFTER.total_seconds() / 20},
        )
        query = text("SELECT count(*) FROM verifications WHERE state <> 'done'")
        return connection.execute(query).scalar_one() == 0


def find_violations(database: Database) -> dict[str, list[str]]:
    """Jobs with which something is wrong, by what is."""
    found = {}
    with database.transaction() as connection:
        for name, query in WRONG.items():
            ids = [str(id_) for id_ in connection.execute(text(query)).scalars()]
            if ids:
                found[name] = ids[:10]
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class PickUp:
    """How a dead worker's job was recovered.

    Attributes:
        seconds: From the death to the next attempt.
        waited_s: The part of them from when the hold was found to be over.
        stage: The job's stage.
        meanwhile: What else was struck in these seconds.
    """

    seconds: float
    waited_s: float
    stage: str
    meanwhile: Sequence[str]


def pick_ups(database: Database, kills: Sequence[Kill]) -> list[PickUp]:
    """How the jobs that dead workers had were recovered, the slowest last."""
    # A prefork worker's jobs are held by its children.
    query = text(
        "SELECT a.worker, a.stage, a.started_at, a.ended_at, (SELECT min(b.started_at) "
        "FROM attempts b WHERE b.job_id = a.job_id AND b.token > a.token) AS next "
        "FROM attempts a WHERE a.result = 'lost'"
    )
    deaths = [(pid, kill.at) for kill in kills if kill.name in WORKERS for pid in kill.pids]
    found = []
    with database.transaction() as connection:
        for row in connection.execute(query):
            pid = _pid(row.worker)
            died = [
                at for dead, at in deaths if dead == pid and row.started_at <= at <= row.ended_at
            ]
            if died and row.next is not None:
                death = min(died)
                found.append(
                    PickUp(
                        seconds=(row.next - death).total_seconds(),
                        waited_s=(row.next - row.ended_at).total_seconds(),
                        stage=row.stage,
                        meanwhile=[s.name for s in kills if death < s.at < row.next],
                    )
                )
    return sorted(found, key=lambda pick_up: pick_up.seconds)


def _pid(worker: str) -> int:
    """The process of a worker: ``kind@host:pid-nonce``, or a runner's ``host-pid.slot``."""
    found = re.search(r":([0-9]+)-[0-9a-f]+$|-([0-9]+)(?:\.[0-9]+)?$", worker)
    assert found is not None, worker
    return int(found[1] or found[2])
