from __future__ import annotations

import pytest

from buildarena_pipeline.catalog.specs import JobSpec, SweepSpec
from buildarena_pipeline.errors import SubmissionError

MODELS = ["builtin/expert", "builtin/idle"]


def spec(**changes: object) -> SweepSpec:
    given = {"tasks": ["support-1"], "models": MODELS, "seeds": [0, 1, 2], **changes}
    return SweepSpec.model_validate(given)


def test_a_sweep_is_the_product_of_its_lists(context, submissions) -> None:
    done = submissions.submit_sweep(spec())
    assert (done.jobs, done.added) == (6, 6)
    jobs = context.store.jobs.page(limit=100, sweep_id=done.sweep.id)
    assert {(job.model, job.seed) for job in jobs} == {(m, s) for m in MODELS for s in (0, 1, 2)}
    assert context.queues.settle()
    assert context.queues.waiting("construct") == 6


def test_the_same_sweep_again_adds_no_job(context, submissions) -> None:
    submissions.submit_sweep(spec())
    again = submissions.submit_sweep(spec(models=[*MODELS, "builtin/random"]))
    assert (again.jobs, again.added) == (9, 3)
    assert context.store.sweeps.progress(again.sweep.id).total == 9


def test_doubled_names_and_seeds_count_once(submissions) -> None:
    done = submissions.submit_sweep(spec(models=["builtin/idle"] * 2, seeds=[1, 1]))
    assert done.jobs == 1


def test_decoding_and_simulator_make_other_jobs(submissions) -> None:
    ids = {
        submissions.submit_job(JobSpec(task="support-1", model="builtin/idle", **changes))[0].id
        for changes in (
            {},
            {"decoding": {"temperature": 0}},
            {"simulator": "mujoco"},
            {"workflow": "builder"},
            {"seed": 1},
        )
    }
    assert len(ids) == 5


def test_a_job_submitted_twice_is_the_same_job(submissions) -> None:
    one = JobSpec(task="support-1", model="builtin/idle")
    (first, new), (second, new_again) = submissions.submit_job(one), submissions.submit_job(one)
    assert (new, new_again) == (True, False)
    assert first.id == second.id


def test_everything_that_is_wrong_is_named_with_the_choices(context, submissions) -> None:
    with pytest.raises(SubmissionError) as caught:
        submissions.submit_sweep(
            spec(tasks=["support-1", "support-9"], models=["gpt"], simulator="moon", workflow="x")
        )
    errors = {issue.path: issue for issue in caught.value.issues}
    assert set(errors) == {"tasks[1]", "models[0]", "simulator", "workflow"}
    assert "support-1" in errors["tasks[1]"].choices
    assert "builtin/expert" in errors["models[0]"].choices
    assert set(errors["simulator"].choices) == {"pybullet", "mujoco"}
    assert context.store.jobs.page(limit=1) == []


@pytest.mark.parametrize("workflow", ["builder", "guidance-builder"])
def test_a_workflow_of_one_structure_is_refused_tasks_that_ask_for_two(
    submissions, workflow
) -> None:
    with pytest.raises(SubmissionError) as caught:
        submissions.submit_sweep(spec(tasks=["lift-2", "lift-3"], workflow=workflow))
    (issue,) = caught.value.issues
    assert issue.path == "tasks[1]"
    assert "lift-3 asks for several sub-structures" in issue.message
    assert issue.choices == ("five-role",)


def test_an_oversized_sweep_is_refused(context, submissions) -> None:
    with pytest.raises(SubmissionError, match="200,000 jobs; the largest accepted has 100,000"):
        submissions.submit_sweep(spec(seeds=None, samples=100_000))
    assert context.store.jobs.page(limit=1) == []


def test_the_papers_samples_are_the_default() -> None:
    assert spec(seeds=None).all_seeds() == list(range(64))


def test_work_goes_on_when_the_broker_is_gone(context, submissions, settings) -> None:
    from buildarena_pipeline.catalog.models import load_registry
    from buildarena_pipeline.runtime.context import open_context
    from buildarena_pipeline.submission.submission import Submissions

    lonely = open_context(settings.model_copy(update={"broker_url": "redis://127.0.0.1:1/0"}))
    try:
        done = Submissions(lonely, load_registry()).submit_sweep(spec())
        assert done.added == 6
        assert lonely.queues.waiting("construct") is None
    finally:
        lonely.close()
    del context, submissions
