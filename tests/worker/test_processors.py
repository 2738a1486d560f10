"""A result of another kind of processor is simulated as it was there, or the report says why."""

import json

import pytest
from support.stages import work

from buildarena_backend.catalog.specs import JobSpec
from buildarena_backend.database import tables
from buildarena_backend.states import Verdict
from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.environment.other_kernels import simulate_with
from buildarena_geometry import Machine, kernels
from buildarena_simulation import processor, write_trajectory
from buildarena_worker.verify import trials
from buildarena_worker.wiring import verifier

SPEC = JobSpec(task="budget-1", model="builtin/expert", simulator="mujoco")
OTHERS = [name for name in kernels.runnable() if name != kernels.PINNED]
several = pytest.mark.skipif(not OTHERS, reason="this processor has one kind of kernels")


@pytest.fixture
def job(context, submissions):
    """A finished bridge of the expert's."""
    submitted, _ = submissions.submit_job(SPEC)
    work(context)
    done = context.store.jobs.get(submitted.id)
    assert done.outcome == "success"
    return done


def as_of(context, job, versions, trajectory: bytes) -> None:
    """Has the job's rollout be another processor's, whose bytes are these."""
    digest = context.artifacts.put(trajectory, "application/vnd.apache.parquet").hash
    with context.store.database.transaction() as connection:
        rows = tables.rollouts.update().where(tables.rollouts.c.job_id == job.id)
        connection.execute(rows.values(versions=versions, trajectory_hash=digest))


def failed(context, job) -> dict[str, dict[str, object]]:
    checks = verifier(context).verify(job.id).as_document()["checks"]
    return {check["name"]: check for check in checks if not check["ok"]}


def elsewhere(context, job) -> bytes:
    """The trajectory's bytes with this processor's second kind of kernels."""
    (record,) = context.store.rollouts.read(job.id)
    document = context.artifacts.get(record.machine_hash)
    machine = Machine.from_document(json.loads(document))
    trajectory = simulate_with(OTHERS[0], builtin_tasks()[SPEC.task], machine, "mujoco")
    return write_trajectory(trajectory)


def test_a_manifest_names_the_processor(job) -> None:
    assert job.manifest["simulator"]["processor"] == dict(processor())


@pytest.mark.ci
@several
def test_a_result_of_other_kernels_is_held_to_those_that_it_names(context, job) -> None:
    (record,) = context.store.rollouts.read(job.id)
    trajectory = elsewhere(context, job)
    level = trials._LEVELS.get(OTHERS[0], trials._LOWEST)
    there = {**processor(), "blas": OTHERS[0], "numpy": level}
    as_of(context, job, {**record.versions, "processor": there}, trajectory)
    assert "rollout 0: trajectory" not in failed(context, job)
    as_of(context, job, {**record.versions, "processor": there}, b"changed")
    assert "rollout 0: processor" not in failed(context, job)
    assert verifier(context).verify(job.id).verdict == Verdict.REFUTED
    # Changed bytes of this processor have no such excuse.
    as_of(context, job, record.versions, b"changed")
    checks = failed(context, job)
    assert "rollout 0: trajectory" in checks
    assert "rollout 0: processor" not in checks
    # Where the kernels are not here, the report says so.
    there = {"blas": "NeoverseN1", "machine": "aarch64"}
    as_of(context, job, {**record.versions, "processor": there}, b"changed")
    checks = failed(context, job)
    assert "rollout 0: trajectory" in checks
    reason = checks["rollout 0: processor"]
    assert reason["kept"] == there
    assert reason["found"]["blas"] == processor()["blas"]
    assert verifier(context).verify(job.id).verdict == Verdict.INCONCLUSIVE


@pytest.mark.nightly
@several
def test_a_result_of_no_named_processor_is_tried_with_all_kernels(
    context, job, monkeypatch
) -> None:
    (record,) = context.store.rollouts.read(job.id)
    trajectory = elsewhere(context, job)
    as_of(context, job, {**record.versions, "processor": "a cloud"}, trajectory)
    assert "rollout 0: trajectory" not in failed(context, job)
    as_of(context, job, {**record.versions, "processor": None}, b"changed")
    # Of a result of before nobody can say that the processor had no part in it.
    assert set(failed(context, job)) == {"rollout 0: trajectory", "rollout 0: processor"}
    assert verifier(context).verify(job.id).verdict == Verdict.INCONCLUSIVE
    # A runner that names none is tried once.
    as_of(context, job, {**record.versions, "processor": None}, trajectory)
    with context.store.database.transaction() as connection:
        connection.execute(tables.rollouts.update().values(runner="key_of_somebody"))
    monkeypatch.setattr(trials, "simulate_with", None)
    assert "rollout 0: trajectory" in failed(context, job)
