"""Stages on the real database, in this process."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from support.stages import work

from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.catalog.specs import JobSpec
from buildarena_pipeline.submission.submission import Submissions
from buildarena_store import Job
from buildarena_worker.wiring import verifier


@pytest.fixture
def run(context, submissions) -> Callable[..., Job]:
    """Submits a job and works on it until it has ended."""

    def submit_and_work(**spec: object) -> Job:
        job, _ = submissions.submit_job(
            JobSpec.model_validate(
                {"task": "support-1", "model": "builtin/expert", "simulator": "mujoco", **spec}
            )
        )
        work(context)
        return context.store.jobs.get(job.id)

    return submit_and_work


def test_a_bridge_is_built_simulated_scored_and_verified(context, run) -> None:
    job = run()
    assert (job.outcome, job.success) == ("success", True)
    assert job.manifest["machine"] == context.store.jobs.artifacts(job.id)["machine"]
    assert job.requests == len(context.store.journal.read(job.id))
    report = verifier(context).verify(job.id).as_document()
    assert report["ok"], [check for check in report["checks"] if not check["ok"]]
    names = {check["name"] for check in report["checks"]}
    assert {"transcript", "rollout 0: trajectory", "score: indicator", "usage: cost_usd"} <= names


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(
    ("statement", "check"),
    [
        ("UPDATE jobs SET indicator = indicator + 1e-9", "score: indicator"),
        ("UPDATE jobs SET input_tokens = input_tokens + 1", "usage: input_tokens"),
        ("UPDATE rollouts SET machine_hash = repeat('0', 64)", "rollout 0: machine"),
        (
            "UPDATE journal SET reply = jsonb_set(reply::jsonb, '{text}', '\"changed\"')",
            "replay",
        ),
        ("DELETE FROM journal WHERE sequence > 10", "replay"),
    ],
)
def test_any_changed_figure_is_found(context, run, statement, check) -> None:
    job = run()
    with context.store.database.transaction() as connection:
        connection.exec_driver_sql(statement)
    report = verifier(context).verify(job.id).as_document()
    assert not report["ok"]
    assert check in {entry["name"] for entry in report["checks"] if not entry["ok"]}


@pytest.mark.parametrize("model", ["builtin/idle", "builtin/random"])
def test_failures_are_scored_and_verified_too(context, run, model) -> None:
    job = run(model=model)
    assert job.success is False
    assert job.indicator == 0.0 or job.outcome == "unsuccessful"
    report = verifier(context).verify(job.id).as_document()
    assert report["ok"], [check for check in report["checks"] if not check["ok"]]


def test_a_limit_keeps_what_was_built(context, run) -> None:
    job = run(limits={"max_requests": 20})
    assert (job.outcome, job.reason, job.requests) == ("limit", "max_requests", 20)
    assert job.metrics["parts"] > 5
    assert "machine" in context.store.jobs.artifacts(job.id)
    assert verifier(context).verify(job.id).as_document()["ok"]


def test_a_job_that_was_never_scored_is_not_verified(context) -> None:
    job, _ = Submissions(context, load_registry()).submit_job(
        JobSpec(task="support-1", model="builtin/idle")
    )
    assert not verifier(context).verify(job.id).as_document()["ok"]


def test_a_missing_key_ends_the_job_as_errored(run, monkeypatch) -> None:
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)
    job = run(model="openai/gpt-4o")
    assert (job.outcome, job.reason) == ("errored", "missing_key")
    assert job.success is None
    assert "OPENAI_API_KEY" in job.detail


@pytest.mark.ci
def test_a_driven_car_is_tried_three_times_and_the_best_counts(context, run) -> None:
    job = run(task="transport-1")
    assert job.outcome == "success"
    records = context.store.rollouts.read(job.id)
    assert [(record.number, record.final) for record in records] == [
        (0, False),
        (1, False),
        (2, True),
    ]
    # The expert does not change what works: the same trial is not simulated again.
    assert records[0].wall_s > 0
    assert [record.wall_s for record in records[1:]] == [0.0, 0.0]
    assert job.indicator == max(record.indicator for record in records)
    assert verifier(context).verify(job.id).as_document()["ok"]


@pytest.mark.ci
def test_an_assembled_rocket_flies(context, run) -> None:
    job = run(task="lift-3")
    assert job.outcome == "success"
    assert verifier(context).verify(job.id).as_document()["ok"]
