"""Stages on the real database, in this process: scored, verified, within a budget."""

import json
from collections.abc import Callable

import pytest
from support.jobs import execute
from support.stages import assert_verified, tampered, work

from buildarena_backend.accounts.budgets import BudgetLimits
from buildarena_backend.agents import submission
from buildarena_backend.agents.sessions import ExternalSessions
from buildarena_backend.catalog import tracks
from buildarena_backend.catalog.models import load_registry
from buildarena_backend.catalog.specs import Budget, JobSpec, SweepSpec
from buildarena_backend.jobs.job import Job
from buildarena_backend.submission.submission import Submissions
from buildarena_worker.builtin import expert
from buildarena_worker.wiring import verifier


@pytest.fixture
def run(context, submissions) -> Callable[..., Job]:
    """Submits a job and works on it until it has ended."""

    def submit_and_work(**spec: object) -> Job:
        usual = {"task": "support-1", "model": "builtin/expert", "simulator": "mujoco"}
        job, _ = submissions.submit_job(JobSpec.model_validate({**usual, **spec}))
        work(context)
        return context.store.jobs.get(job.id)

    return submit_and_work


def test_a_bridge_is_built_simulated_scored_and_verified(context, run) -> None:
    job = run()
    assert (job.outcome, job.success) == ("success", True)
    assert job.manifest["machine"] == context.store.jobs.artifacts(job.id)["machine"]
    assert job.requests == len(context.store.journal.read(job.id))
    report = verifier(context).verify(job.id).as_document()
    assert report["ok"], report
    names = {check["name"] for check in report["checks"]}
    assert {"transcript", "rollout 0: trajectory", "score: indicator", "usage: cost_usd"} <= names


TAMPERINGS = {
    "UPDATE jobs SET indicator = indicator + 1e-9": "score: indicator",
    "UPDATE jobs SET input_tokens = input_tokens + 1": "usage: input_tokens",
    "UPDATE rollouts SET machine_hash = repeat('0', 64)": "rollout 0: machine",
    """UPDATE journal SET reply = jsonb_set(reply::jsonb, '{text}', '"changed"')""": "replay",
    "DELETE FROM journal WHERE sequence > 10": "replay",
}


def test_any_changed_figure_is_found(context, run, subtests) -> None:
    job = run(task="lift-1")
    for statement, check in TAMPERINGS.items():
        with subtests.test(statement=statement), tampered(context, statement):
            report = verifier(context).verify(job.id).as_document()
            assert not report["ok"]
            assert check in {entry["name"] for entry in report["checks"] if not entry["ok"]}
    assert_verified(context, job.id)


@pytest.mark.parametrize("model", ["builtin/idle", "builtin/random"])
def test_failures_are_scored_and_verified_too(context, run, model) -> None:
    job = run(model=model)
    assert job.success == 0
    assert job.indicator == 0.0 or job.outcome == "unsuccessful"
    assert_verified(context, job.id)


def test_a_limit_keeps_what_was_built(context, run) -> None:
    job = run(task="lift-1", limits={"max_requests": 20})
    assert (job.outcome, job.reason, job.requests) == ("limit", "max_requests", 20)
    assert job.metrics["parts"] > 5
    assert "machine" in context.store.jobs.artifacts(job.id)
    assert_verified(context, job.id)


def test_a_job_that_reaches_the_protocols_own_limit_has_failed(context, run, monkeypatch) -> None:
    monkeypatch.setattr(tracks, "STANDARD_MAX_REQUESTS", 20)
    job = run()
    found = (job.outcome, job.reason, job.requests, job.success)
    assert found == ("construction_failed", "max_requests", 20, 0)
    assert_verified(context, job.id)


def test_a_job_that_was_never_scored_is_not_verified(context) -> None:
    spec = JobSpec(task="support-1", model="builtin/idle")
    job, _ = Submissions(context, load_registry()).submit_job(spec)
    assert not verifier(context).verify(job.id).as_document()["ok"]


def test_a_missing_key_ends_the_job_as_errored(run, monkeypatch) -> None:
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)
    job = run(model="openai/gpt-4o")
    assert (job.outcome, job.reason) == ("errored", "missing_key")
    assert job.success is None
    assert "OPENAI_API_KEY" in job.detail


@pytest.mark.ci
def test_a_tested_control_that_is_kept_is_scored_without_another_trial(context, run) -> None:
    job = run(task="transport-1")
    assert job.outcome == "success"
    records = context.store.rollouts.read(job.id)
    assert [(record.number, record.final) for record in records] == [(0, False), (1, True)]
    # The same trial is not simulated again.
    assert [record.wall_s > 0 for record in records] == [True, False]
    assert job.indicator == records[1].indicator == records[0].indicator
    assert_verified(context, job.id)


@pytest.mark.ci
def test_a_car_never_kept_has_three_test_trials_and_the_fourth_counts(
    context, run, monkeypatch
) -> None:
    monkeypatch.setattr(expert, "_control", lambda design, _: json.dumps(design.control))
    job = run(task="transport-1")
    records = context.store.rollouts.read(job.id)
    assert [record.final for record in records] == [False, False, False, True]
    assert job.metrics["test_trials"] == 3
    # The last test trial is in a world of its own.
    assert [record.wall_s > 0 for record in records] == [True, False, True, False]
    assert [record.seed is None for record in records] == [True, True, False, True]
    assert job.indicator == records[3].indicator != records[2].indicator
    assert_verified(context, job.id)


@pytest.mark.ci
def test_an_assembled_rocket_flies(context, run) -> None:
    job = run(task="lift-3")
    assert job.outcome == "success"
    assert_verified(context, job.id)


ROCKET = (
    ("start", {}),
    ("attach_block_to", {"base_block": "1", "face": "A", "new_block": "Water Cannon"}),
    ("shift_block", {"block_id": "2", "shift_real": [0.5, 0, 0]}),
    ("shift_block", {"block_id": "2", "shift_real": [0.5, 0, 0]}),
)


def _submitted(context) -> str:
    sessions = ExternalSessions(context)
    job = sessions.open(task="lift-1", agent="me", seed=0, simulator="mujoco")[0].job
    for tool, arguments in ROCKET:
        done = sessions.call(job.id, machine="main", tool=tool, arguments=arguments)
        assert done.ok, done.feedback
    sessions.submit(job.id)
    work(context)
    return job.id


def test_a_machine_that_was_let_through_fails_verification(context, monkeypatch) -> None:
    monkeypatch.setattr(submission, "broken_constraint", lambda *_: None)
    job = _submitted(context)
    assert context.store.jobs.get(job).outcome == "unsuccessful"
    report = verifier(context).verify(job).as_document()
    assert not report["ok"]
    wrong = [check for check in report["checks"] if not check["ok"]]
    assert [(check["name"], check["found"]) for check in wrong] == [("reason", "unjoined_parts")]


def test_a_machine_that_was_refused_is_verified_as_refused(context) -> None:
    job = _submitted(context)
    assert context.store.jobs.get(job).reason == "unjoined_parts"
    assert_verified(context, job)


PAYLOAD = {"tasks": ["lift-1"], "models": ["paid/expert"], "simulator": "mujoco"}


def test_a_sweep_stops_at_its_budget_and_goes_on_with_more(context, submissions) -> None:
    spec = SweepSpec(**PAYLOAD, seeds=[0, 1, 2, 3, 4, 5], budget=Budget(max_requests=20))
    sweep_id = submissions.submit_sweep(spec).sweep.id
    work(context, threads=4)
    assert context.store.sweeps.get(sweep_id).state == "budget_exhausted"
    budget = context.store.budgets.get(sweep_id)
    assert budget.spent_requests == 20
    on_hold = context.store.jobs.page(limit=10, state="on_hold")
    assert on_hold
    assert all("max_requests is 20" in job.detail for job in on_hold if job.requests)

    more = spec.model_copy(update={"budget": Budget(max_requests=10_000)})
    again = submissions.submit_sweep(more, resume=True)
    assert (again.sweep.id, again.resumed) == (sweep_id, True)
    work(context, threads=4)
    assert context.store.sweeps.progress(sweep_id).outcomes == {"success": 6}
    jobs = context.store.jobs.page(limit=10)
    # No reply was paid for twice: the budget knows of no request that the journals lack.
    journaled = sum(len(context.store.journal.read(job.id)) for job in jobs)
    assert context.store.budgets.get(sweep_id).spent_requests == journaled
    assert journaled == sum(job.requests for job in jobs)


def test_built_in_models_use_up_no_budget_and_go_on_without_one(context, submissions) -> None:
    models = ["builtin/expert", "paid/expert"]
    spec = SweepSpec(**PAYLOAD | {"models": models}, seeds=[0, 1], budget=Budget(max_requests=5))
    sweep_id = submissions.submit_sweep(spec).sweep.id
    work(context)
    assert context.store.sweeps.get(sweep_id).state == "budget_exhausted"
    progress = context.store.sweeps.progress(sweep_id)
    assert (progress.outcomes, progress.requests) == ({"success": 2}, 5)
    assert context.store.budgets.get(sweep_id).spent_requests == 5
    later = {"max_requests": 10_000, "max_cost_usd": None, "max_tokens": None}
    with context.store.database.transaction() as connection:
        context.store.budgets.set(sweep_id, BudgetLimits(**later), connection=connection)
    assert context.store.budgets.get(sweep_id).spent_requests == 5


def test_a_small_token_budget_stops_before_the_first_request(context, submissions) -> None:
    spec = SweepSpec(**PAYLOAD, seeds=[0], budget=Budget(max_tokens=1000))
    sweep_id = submissions.submit_sweep(spec).sweep.id
    work(context, threads=4)
    assert context.store.sweeps.get(sweep_id).state == "budget_exhausted"
    assert context.store.budgets.get(sweep_id).spent_requests == 0
    (job,) = context.store.jobs.page(limit=2)
    assert job.outcome is None
    assert "max_tokens is 1,000, 0 is spent" in job.detail


def test_what_costs_nothing_goes_on_without_dollars(context, submissions, monkeypatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "never-sent")
    models = ["openai/gpt-4o", "builtin/idle"]
    budget = Budget(max_cost_usd=0.000001)
    spec = SweepSpec(**{**PAYLOAD, "models": models}, seeds=[0, 1], budget=budget)
    sweep_id = submissions.submit_sweep(spec).sweep.id
    # The dollars are used up before anything else has begun.
    execute(context, "UPDATE jobs SET queue = 'later' WHERE model = 'builtin/idle'")
    work(context, queues=("construct",))
    assert context.store.sweeps.get(sweep_id).state == "budget_exhausted"
    execute(context, "UPDATE jobs SET queue = 'construct' WHERE model = 'builtin/idle'")
    work(context)
    progress = context.store.sweeps.progress(sweep_id)
    assert progress.stages == {"construct on_hold": 2}
    assert progress.outcomes == {"construction_failed": 2}
    assert context.store.sweeps.get(sweep_id).state == "budget_exhausted"


def test_resuming_a_finished_sweep_does_nothing_twice(context, submissions) -> None:
    spec = SweepSpec(**PAYLOAD, seeds=[0])
    first = submissions.submit_sweep(spec)
    work(context, threads=4)
    second = submissions.submit_sweep(spec, resume=True)
    assert (second.sweep.id, second.added) == (first.sweep.id, 0)
    other = submissions.submit_sweep(SweepSpec(**PAYLOAD, seeds=[0, 1]), resume=True)
    assert (other.resumed, other.added) == (False, 1)
