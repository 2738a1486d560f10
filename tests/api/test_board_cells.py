"""Boards equal boards that are made from every ended job in the plain way, whatever changes."""

import random
from contextlib import ExitStack
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import delete, insert, select, text, update
from starlette.testclient import TestClient
from support.boards.plain_boards import ended_trials, plain_board
from support.jobs import execute
from support.servers.live_api import api_client
from support.statements import statements_of

from buildarena_api.leaderboard.views import board_view
from buildarena_backend.catalog.models import load_registry
from buildarena_backend.database.tables import jobs, sweep_jobs, sweeps
from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.leaderboard import BoardQuery

TRACKS = ("first/track-1", "second/track-1")
START = datetime(2026, 1, 1, tzinfo=UTC)
FLAGS = (None, [], ["unstable"], ["never_fell"], ["no_wheels", "never_fell"], ["new"], ["refuted"])
TASKS = ("lift-1", "support-1", "somebodys-own")
BOARD = {"track": TRACKS[0]}


def random_job(rng: random.Random, number: int) -> dict[str, object]:
    """An ended job with every oddity that jobs may have."""
    task, provider = rng.choice(TASKS), rng.choice(("made-up", "made-up", "external", "file"))
    version = builtin_tasks()[task].version if task in builtin_tasks() else "v1"
    model = f"{provider}/{rng.randrange(3)}"
    failed = ["unsuccessful", "construction_failed", "limit", "errored", "cancelled"]
    outcome = rng.choice(["success"] * 4 + failed)
    audited = rng.random() < 0.2
    return {
        "id": f"job_{number:020d}",
        "task": task,
        "task_version": rng.choice((version, version, version, "old")),
        "model": model,
        "model_hash": f"{model} {rng.randrange(2)}",
        "model_config": {"provider": provider, "decoding": {"temperature": 0.1}},
        "limits": rng.choice(({}, {"requests": 5})) if provider == "x" else {},
        "track": rng.choice(TRACKS),
        "track_config": {},
        "seed": number,
        "stage": "simulate",
        "queue": "simulate.pybullet",
        "state": "done",
        "outcome": outcome,
        "reason": rng.choice(("objection", None)) if outcome != "success" else None,
        "success": rng.choice((0.25, 1.0)) * (outcome == "success") if rng.random() < 0.9 else None,
        "indicator": rng.choice((None, 0.0, 5.0, rng.expovariate(0.01), -rng.random())),
        "metrics": rng.choice(
            (None, {}, {"parts": rng.randrange(90), "test_trials": rng.randrange(4)})
        ),
        "flags": rng.choice(FLAGS),
        "refusals": rng.choice((None, {}, {"overlap": 3}, {"overlap": 1, "full": 0})),
        "requests": rng.choice((rng.randrange(100), 2**40 + rng.randrange(100))),
        "input_tokens": rng.randrange(10**9),
        "output_tokens": rng.choice((0, rng.randrange(10**6))),
        "cost_usd": round(rng.random(), 6),
        "actions": rng.choice((rng.randrange(9), 2**40 + rng.randrange(9))),
        "refused_actions": rng.randrange(3),
        "finished_at": START + timedelta(hours=rng.randrange(1000)),
        "ran_on_runner": rng.random() < 0.3,
        "audit": rng.choice(("required", "verified", "refuted", None)) if audited else None,
    }


def disturb(context, rng: random.Random, number: int) -> None:
    """What happens to jobs: they end, leave, are scored again, verified, deleted."""
    kinds = ("end", "end", "rescore", "leave", "delete", "verify", "refusals", "empty a cell")
    with context.store.database.transaction() as connection:
        ids = connection.execute(select(jobs.c.id).order_by(jobs.c.id)).scalars().all()
        some = [id_ for id_ in ids if rng.random() < 0.1]
        kind = rng.choice(kinds) if ids else "end"
        here = jobs.c.id.in_(some)
        if kind == "end":
            rows = [random_job(rng, number * 100 + place) for place in range(rng.randrange(1, 12))]
            connection.execute(insert(jobs), rows)
        elif kind == "rescore":
            values = {"indicator": rng.random() * 100, "flags": rng.choice(FLAGS[1:])}
            connection.execute(update(jobs).where(here).values(**values))
        elif kind == "leave":
            connection.execute(update(jobs).where(here).values(state="queued", outcome=None))
        elif kind == "verify":
            waiting = jobs.c.audit == "required"
            audit = rng.choice(("verified", "refuted"))
            connection.execute(update(jobs).where(waiting).values(audit=audit))
        elif kind == "refusals":
            connection.execute(update(jobs).where(here).values(refusals={"overlap": number}))
        elif kind == "delete":
            connection.execute(delete(sweep_jobs).where(sweep_jobs.c.job_id.in_(some)))
            connection.execute(delete(jobs).where(here))
        else:
            cell = jobs.c.task == rng.choice(TASKS), jobs.c.model == "made-up/0"
            connection.execute(update(jobs).where(*cell).values(state="queued"))


def random_query(rng: random.Random) -> dict[str, object]:
    """Parameters of a board, as readers choose them."""
    found = {"track": rng.choice(TRACKS)}
    further = {"task": rng.sample(sorted(builtin_tasks()), 8), "sweep": "sweep_some"}
    further["model"] = ["made-up/0", "external/1"]
    return found | {name: value for name, value in further.items() if rng.random() < 0.3}


def expected(context, params: dict[str, object]) -> bytes | None:
    """The board in the plain way; None when the track has no such job."""
    every = ended_trials(context)
    members = {*context.store.sweeps.job_ids("sweep_some")} if "sweep" in params else None
    tracks = sorted({t.track for t in every if members is None or t.job_id in members})
    if params["track"] not in tracks:
        return None
    tasks = context.tasks.newest().values()
    query = BoardQuery(
        tasks=frozenset(params["task"]) if "task" in params else None,
        models=frozenset(params["model"]) if "model" in params else None,
        overall=None if "task" in params else frozenset(builtin_tasks()),
    )
    own = [trial for trial in every if trial.track == params["track"]]
    board = plain_board(
        own,
        query,
        {task.name: task.version for task in tasks},
        inside=lambda t: members is None or t.job_id in members,
    )
    facts = {"track": params["track"], "tracks": tracks}
    view = board_view(board, **facts, registry=load_registry(), catalogue=context.tasks)
    return view.model_dump_json().encode()


def asked(api, params: dict[str, object]) -> bytes | None:
    """The same from the API."""
    found = api.get("/v1/leaderboard", params=params)
    return None if found.status_code == 422 else found.content


@pytest.fixture
def process(context):
    """Starts what further API processes would have in memory, on the same database."""
    with ExitStack() as stack:

        def start() -> TestClient:
            return stack.enter_context(api_client(context))

        yield start


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("seed", range(4))
def test_boards_equal_boards_made_from_every_job(context, process, seed) -> None:
    rng = random.Random(seed)
    first, second = process(), process()
    execute(context, insert(jobs), [random_job(rng, number) for number in range(60)])
    execute(context, insert(sweeps).values(id="sweep_some", name="some", spec={}, state="active"))
    members = [{"sweep_id": "sweep_some", "job_id": f"job_{n:020d}"} for n in range(0, 60, 2)]
    execute(context, insert(sweep_jobs), members)
    for step in range(8):
        for api in rng.sample([first, second, process()], 2):
            params = random_query(rng)
            assert asked(api, params) == expected(context, params), params
        disturb(context, rng, step + 1)


@pytest.fixture
def filled(context) -> None:
    rng = random.Random(7)
    execute(context, insert(jobs), [random_job(rng, number) for number in range(16)])


def change(context, indicator: float) -> None:
    execute(context, update(jobs).values(indicator=indicator))


@pytest.mark.usefixtures("filled")
def test_a_question_at_rest_is_one_look_at_the_log(context, process) -> None:
    api = process()
    asked(api, BOARD)
    with statements_of(context.store.database.engine) as statements:
        api.app.state.services.boards.tracks()
    assert len(statements) == 1
    assert "board_changes" in statements[0]


@pytest.mark.usefixtures("filled")
def test_a_change_in_an_open_transaction_is_found_once_it_ends(context, process) -> None:
    api = process()
    with context.store.database.transaction() as slow:
        slow.execute(update(jobs).where(jobs.c.id == f"job_{0:020d}").values(indicator=999.0))
        # A later change is taken in, and kept, while the earlier one can't be seen.
        later = update(jobs).where(jobs.c.id != f"job_{0:020d}")
        execute(context, later.values(indicator=1.0))
        assert asked(api, BOARD) == expected(context, BOARD)
    assert asked(api, BOARD) == asked(process(), BOARD) == expected(context, BOARD)


def test_a_file_that_was_tried_is_no_cell(context, process) -> None:
    job = random_job(random.Random(1), 1) | {"model_config": {"provider": "file"}}
    execute(context, insert(jobs).values(**job))
    api = process()
    for indicator in (3.0, 4.0):
        assert api.get("/v1/leaderboard").json()["tracks"] == []
        change(context, indicator)


@pytest.mark.usefixtures("filled")
def test_a_database_that_went_back_in_time_is_read_anew(context, process) -> None:
    """A backup was restored under a process: numbers of transactions begin again."""
    api = process()
    asked(api, BOARD)
    boards = api.app.state.services.boards
    boards._mark = f"{10**9}:{10**9}:"
    with context.store.database.transaction() as connection:
        connection.execute(text("ALTER TABLE jobs DISABLE TRIGGER USER"))
        connection.execute(update(jobs).values(indicator=79.0))
        connection.execute(text("ALTER TABLE jobs ENABLE TRIGGER USER"))
    assert asked(api, BOARD) == expected(context, BOARD)
