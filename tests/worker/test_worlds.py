"""Finished machines are scored in varied worlds, which no model can know of."""

import json
from fractions import Fraction

import pytest
from sqlalchemy import text
from support.boards.plain_boards import ended_trials
from support.player import Player
from support.providers.scripted import Recording
from support.servers.live_api import changed
from support.stages import tampered, verdict, work

from buildarena_backend.agents.sessions import ExternalSessions
from buildarena_backend.boards.trials import TrialFilter
from buildarena_backend.catalog.models import load_registry
from buildarena_backend.catalog.specs import ClosedLoop, JobSpec, SweepSpec
from buildarena_backend.errors import SubmissionError
from buildarena_backend.jobs.job import Job
from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_backend.process.context import Context
from buildarena_backend.settings import Settings
from buildarena_backend.submission.submission import Submissions
from buildarena_benchmark.leaderboard import summarise
from buildarena_geometry import Machine
from buildarena_simulation import constants, read_trajectory, simulate, write_trajectory

WORLDS = 3
SAME_TWICE = """
    UPDATE rollouts SET seed = other.seed, trajectory_hash = other.trajectory_hash
    FROM rollouts AS other WHERE rollouts.job_id = :job AND rollouts.number = 3
    AND other.job_id = :job AND other.number = 2
"""


def tried(context: Context, submissions: Submissions, **spec: object) -> Job:
    """A job of the expert that was tried in varied worlds."""
    asked = {"task": "lift-1", "model": "builtin/expert", "worlds": WORLDS, **spec}
    job, _ = submissions.submit_job(JobSpec(**asked))
    work(context)
    return context.store.jobs.get(job.id)


def rollouts(context: Context, job: Job) -> tuple[list[RolloutRecord], list[RolloutRecord]]:
    """Those in the exact world, and those in varied ones."""
    records = context.store.rollouts.read(job.id)
    return [r for r in records if r.seed is None], [r for r in records if r.seed is not None]


@pytest.mark.ci
def test_each_world_is_a_trial_of_one_machine_and_the_job_has_the_mean(
    context, submissions
) -> None:
    job = tried(context, submissions)
    assert f"+{WORLDS}-worlds/" in job.track
    exact, varied = rollouts(context, job)
    assert (len(exact), len(varied)) == (1, WORLDS)
    assert {r.machine_hash for r in varied} == {exact[0].machine_hash}
    assert len({r.seed for r in varied}) == WORLDS
    assert len({r.trajectory_hash for r in (*exact, *varied)}) == WORLDS + 1
    worlds = [*exact, *varied]
    won = [r for r in worlds if r.success]
    mean = sum(Fraction(r.indicator) for r in won) / len(worlds)
    assert (job.success, job.indicator) == (len(won) / len(worlds), pytest.approx(float(mean)))
    assert (job.metrics["worlds"], job.metrics["worlds_passed"]) == (WORLDS + 1, len(won))
    assert verdict(context, job.id) == "verified"


@pytest.mark.nightly
def test_seeds_are_drawn_anew_for_each_job(context, submissions) -> None:
    jobs = [tried(context, submissions, seed=seed) for seed in (0, 1)]
    seeds = [{r.seed for r in rollouts(context, job)[1]} for job in jobs]
    assert not seeds[0] & seeds[1]


@pytest.mark.nightly
def test_the_best_of_several_trials_is_what_worlds_try(context, submissions) -> None:
    # Its controller tries several times; a closed loop ends in its session, not in a trial.
    loop = ClosedLoop(rounds=2)
    job = tried(context, submissions, task="transport-1", closed_loop=loop, worlds=1)
    exact, varied = rollouts(context, job)
    best = max(exact, key=lambda r: (r.success, r.indicator, -r.number))
    assert len(varied) == 1
    kept = {(best.machine_hash, str(best.controls))}
    assert {(one.machine_hash, str(one.controls)) for one in varied} == kept
    assert verdict(context, job.id) == "verified"


def test_what_breaks_a_rule_is_tried_in_no_world(context, submissions) -> None:
    job = tried(context, submissions, model="builtin/idle")
    assert (job.success, rollouts(context, job)) == (False, ([], []))


TAMPERINGS = (
    "DELETE FROM rollouts WHERE job_id = :job AND number = 3",
    SAME_TWICE,
    "UPDATE rollouts SET seed = seed + 1 WHERE job_id = :job AND number = 3",
    "UPDATE rollouts SET success = NOT success WHERE job_id = :job AND number = 3",
    "UPDATE jobs SET success = success / 2 WHERE id = :job",
    "UPDATE jobs SET indicator = indicator + 1 WHERE id = :job",
    "UPDATE jobs SET metrics = metrics - 'worlds_passed' WHERE id = :job",
)


@pytest.mark.ci
def test_no_world_can_be_left_out_or_changed(context, submissions, subtests) -> None:
    job = tried(context, submissions)
    for tampering in TAMPERINGS:
        with subtests.test(tampering=tampering), tampered(context, tampering, job=job.id):
            assert verdict(context, job.id) == "refuted"
    assert verdict(context, job.id) == "verified"


@pytest.mark.ci
def test_boards_count_a_job_by_its_share_of_worlds(context, submissions) -> None:
    jobs = [tried(context, submissions, seed=seed) for seed in (0, 1)]
    with context.store.database.transaction() as connection:
        connection.execute(text("UPDATE jobs SET success = 0.25 WHERE id = :j"), {"j": jobs[0].id})
    (cell,) = context.store.results.boards.cells.of(TrialFilter(track=jobs[0].track))
    (tally,) = cell.tallies
    assert sorted(tally.shares) == [0.25, 1.0]
    found = summarise(ended_trials(context))
    assert (found.successes, found.success_rate) == (1.25, 0.625)
    assert found.pass_at["2"] == 1.0
    assert found.pass_all["2"] == 0.25


def test_a_service_varies_unless_it_is_told_otherwise(monkeypatch, context) -> None:
    monkeypatch.delenv("BUILDARENA_WORLDS", raising=False)
    default = Settings().worlds
    assert default >= 4
    with changed(context, worlds=default) as own:
        submissions = Submissions(own, load_registry())
        job, _ = submissions.submit_job(JobSpec(task="lift-1", model="builtin/idle"))
        assert f"+{default}-worlds/" in job.track
        plain, _ = submissions.submit_job(JobSpec(task="lift-1", model="builtin/idle", worlds=0))
        assert "worlds" not in plain.track


def test_a_game_has_no_worlds_that_a_seed_could_vary(context) -> None:
    with changed(context, besiege_game="1.0", besiege_mod="1.0", worlds=4) as own:
        submissions = Submissions(own, load_registry())
        spec = {"tasks": ["lift-1"], "models": ["builtin/idle"], "simulator": "besiege"}
        (job,) = submissions.plan(SweepSpec(**spec, samples=1))
        assert "worlds" not in job.track
        with pytest.raises(SubmissionError, match="worlds"):
            submissions.plan(SweepSpec(**spec, samples=1, worlds=2))


@pytest.mark.ci
def test_a_world_can_be_run_again_by_anybody(context, submissions) -> None:
    job = tried(context, submissions)
    record = rollouts(context, job)[1][0]
    kept = context.artifacts.get(record.trajectory_hash)
    machine = Machine.from_document(json.loads(context.artifacts.get(record.machine_hash)))
    task = context.tasks.exact(job.task, job.task_version)
    again = simulate(machine, task.scenario, record.engine, seed=record.seed)
    assert read_trajectory(kept).settings["seed"] == record.seed
    assert write_trajectory(again) == kept


RANGES = ("START_SHIFT", "START_DROP", "START_YAW_DEG", "CARGO_SHIFT", "KEY_DELAY_S")


def told_of_worlds(words: str) -> str:
    """The paragraph on varied worlds; empty where there is none."""
    return next((line for line in words.splitlines() if line.startswith("**Worlds.**")), "")


def test_every_role_is_told_of_the_worlds_that_score_it(subtests) -> None:
    for worlds in [0, 1, 5]:
        with subtests.test(worlds=worlds):
            model = Recording()
            Player()("builtin/expert", client=model, worlds=worlds)
            for request in model.requests:
                text = "\n".join(message.text for message in request.messages)
                if "# Build a bridge" in text:
                    assert told_of_worlds(text).startswith("**Worlds.**") is bool(worlds)
            told = "\n".join(message.text for message in model.requests[0].messages)
            assert_tells(told_of_worlds(told), worlds)


def test_agents_are_told_of_the_worlds_that_score_them(context, subtests) -> None:
    for worlds in [0, 1, 5]:
        with subtests.test(worlds=worlds):
            opened, _ = ExternalSessions(context).open(
                task="lift-1", agent="told", seed=worlds, simulator="pybullet", worlds=worlds
            )
            assert_tells(told_of_worlds(opened.briefing), worlds)


def assert_tells(told: str, worlds: int) -> None:
    """It says how many worlds there are and every range that a seed draws from; nothing of none."""
    assert bool(told) is bool(worlds)
    if worlds:
        assert f" {worlds} further world" in told
        for name in RANGES:
            assert f"{getattr(constants, name):g}" in told, name
