"""Fills a database with very many jobs, as fast as the database can make them up."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from sqlalchemy import Connection, text

from buildarena_backend.database.database import Database
from buildarena_benchmark import builtin_tasks

MODELS = 50
TRACKS = ("five-role/pybullet-1/default-00000000-1", "single/mujoco-1/default-00000000-1")
OWNERS = 20
SWEEP_SIZE = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Amount:
    """How much a database holds.

    Attributes:
        ended: Jobs that have ended.
        queued: Jobs that wait.
        models: Models that they are of.
    """

    ended: int
    queued: int
    models: int = MODELS


def fill(database: Database, amount: Amount) -> None:
    """Stores jobs with sweeps, attempts and what the triggers would have logged."""
    with database.engine.connect() as connection:
        connection.execution_options(isolation_level="AUTOCOMMIT")
        # What triggers write is written for all rows at once.
        connection.execute(text("SET session_replication_role = replica"))
        connection.execute(text("SET synchronous_commit = off"))
        connection.execute(text("SET maintenance_work_mem = '256MB'"))
        _name_tasks(connection)
        with without_indexes(connection, ("jobs", "sweep_jobs", "attempts", "board_changes")):
            _jobs(connection, "ended", amount.ended, amount.models)
            _jobs(connection, "queued", amount.queued, amount.models)
            _ended(connection)
        connection.execute(text("SET session_replication_role = origin"))
        connection.execute(text("VACUUM ANALYZE"))
        connection.execute(text("DROP TABLE made_up_tasks"))
        connection.execute(text("RESET ALL"))


def _name_tasks(connection: Connection) -> None:
    connection.execute(
        text("CREATE TEMP TABLE made_up_tasks (number int, name text, version text, level int)")
    )
    rows = [
        {"number": number, "name": task.name, "version": task.version, "level": task.level}
        for number, task in enumerate(builtin_tasks().values())
    ]
    connection.execute(
        text("INSERT INTO made_up_tasks VALUES (:number, :name, :version, :level)"), rows
    )


@contextmanager
def without_indexes(connection: Connection, tables: tuple[str, ...]) -> Iterator[None]:
    """Takes indexes away that no constraint needs, and makes them again at the end."""
    found = connection.execute(
        text(
            "SELECT indexname, indexdef FROM pg_indexes WHERE tablename = ANY(:tables) "
            "AND indexname NOT IN (SELECT conname FROM pg_constraint)"
        ),
        {"tables": list(tables)},
    ).all()
    for row in found:
        connection.execute(text(f'DROP INDEX "{row.indexname}"'))
    yield
    for row in found:
        connection.exec_driver_sql(row.indexdef)


def _jobs(connection: Connection, kind: str, count: int, models: int) -> None:
    if not count:
        return
    connection.execute(
        text(JOBS),
        {
            "kind": kind,
            "count": count,
            "models": models,
            "tracks": list(TRACKS),
            "owners": OWNERS,
            "sweep_size": SWEEP_SIZE,
            "first_seed": 0 if kind == "ended" else 1,
        },
    )
    connection.execute(text(SWEEPS), {"kind": kind})


def _ended(connection: Connection) -> None:
    connection.execute(text(ATTEMPTS))
    connection.execute(text(CHANGES))


# Numbers are spread over tasks, models and tracks; "random" figures are hashes of the number, so
# that every run makes the same database.
JOBS = """
WITH numbers AS (
    SELECT n, n % 9 AS task, n / 9 % :models AS model, n / 9 / :models % 2 AS track,
        n / 9 / :models / 2 * 2 + :first_seed AS seed,
        (hashint8(n) & 65535) / 65536.0 AS luck, (hashint8(n * 7 + 1) & 65535) / 65536.0 AS other,
        :kind = 'ended' AS ended
    FROM generate_series(0, :count - 1) AS n
), made AS (
    SELECT numbers.*, made_up_tasks.name, version,
        luck < (model + 1.0) / (:models + 1) / level AND ended AS won
    FROM numbers JOIN made_up_tasks ON task = number
)
INSERT INTO jobs (id, task, task_version, model, model_hash, model_config, track, track_config,
    seed, owner, payer, stage, queue, state, outcome, reason, success, indicator, metrics, flags,
    manifest, requests, input_tokens, output_tokens, cost_usd, actions, refused_actions, refusals,
    lease_token, created_at, available_at, started_at, finished_at)
SELECT 'job_' || substr(md5(:kind || n), 1, 20), name, version,
    'made-up/model-' || model, md5('configuration' || model),
    jsonb_build_object('name', 'made-up/model-' || model, 'provider', 'made-up', 'model', model,
        'decoding', jsonb_build_object('temperature', 0.5, 'top_p', 0.7)),
    (CAST(:tracks AS text[]))[track + 1], '{"workflow": "five-role"}'::jsonb,
    seed, 'key_' || n / :sweep_size % :owners, 'sweep_' || :kind || n / :sweep_size,
    CASE WHEN ended THEN 'simulate' ELSE 'construct' END,
    CASE WHEN ended THEN 'simulate.pybullet' ELSE 'construct' END,
    CASE WHEN ended THEN 'done' ELSE 'queued' END,
    CASE WHEN NOT ended THEN NULL WHEN won THEN 'success' WHEN other < 0.1
        THEN 'construction_failed' WHEN other > 0.99 THEN 'errored' ELSE 'unsuccessful' END,
    CASE WHEN ended AND NOT won AND other < 0.1 THEN 'objection'
        WHEN ended AND NOT won AND other > 0.99 THEN 'lost_worker' END,
    CASE WHEN ended THEN won::int END,
    CASE WHEN won THEN -100 * ln(1 - other) WHEN ended AND other >= 0.1 THEN 5 * other
        WHEN ended THEN 0 END,
    CASE WHEN ended THEN jsonb_build_object('parts', 5 + (85 * luck)::int, 'mass', 10.5) END,
    CASE WHEN ended THEN CASE WHEN other > 0.97 THEN '["unstable"]'::jsonb
        WHEN other < 0.02 THEN '["never_fell"]'::jsonb ELSE '[]'::jsonb END END,
    CASE WHEN ended THEN jsonb_build_object('geometry', '1.0', 'simulation', '3', 'prompts',
        md5('prompts'), 'commit', md5('commit'), 'seed', seed) END,
    CASE WHEN ended THEN 20 + (180 * luck)::int ELSE 0 END,
    CASE WHEN ended THEN 100000 + (9e6 * other)::int ELSE 0 END,
    CASE WHEN ended THEN 10000 + (9e5 * luck)::int ELSE 0 END,
    CASE WHEN ended THEN round(other::numeric, 6) ELSE 0 END,
    CASE WHEN ended THEN 100 ELSE 0 END, CASE WHEN ended THEN 4 ELSE 0 END,
    CASE WHEN ended THEN jsonb_build_object('overlap', (4 * luck)::int, 'face_occupied', 1) END,
    CASE WHEN ended THEN 2 ELSE 0 END,
    moment, moment, CASE WHEN ended THEN moment + interval '1 minute' END,
    CASE WHEN ended THEN moment + interval '1 minute' + luck * interval '1 hour' END
FROM made, LATERAL (
    SELECT timestamptz '2025-01-01' + n * interval '30 seconds' AS moment
) AS times
"""
SWEEPS = """
WITH added AS (
    INSERT INTO sweeps (id, name, spec, state, owner, created_at)
    SELECT payer, payer, '{}'::jsonb, 'active', min(owner), min(created_at)
    FROM jobs WHERE payer LIKE 'sweep_' || :kind || '%' GROUP BY payer
)
INSERT INTO sweep_jobs (sweep_id, job_id) SELECT payer, id FROM jobs
WHERE payer LIKE 'sweep_' || :kind || '%'
"""
ATTEMPTS = """
INSERT INTO attempts (job_id, token, stage, worker, started_at, ended_at, result)
SELECT id, token, CASE token WHEN 1 THEN 'construct' ELSE 'simulate' END, 'worker_1',
    started_at, finished_at, 'done'
FROM jobs, generate_series(1, 2) AS token WHERE state = 'done' AND model LIKE 'made-up/%'
"""
CHANGES = """
INSERT INTO board_changes (transaction, job_id, track, task, task_version, configuration, kind)
SELECT pg_current_xact_id()::text::bigint, id, track, task, task_version, model_hash,
    CASE WHEN outcome = 'errored' THEN 'unscored' ELSE 'entered' END
FROM jobs WHERE state = 'done'
"""
