"""The catalogue of tasks: built-in and uploaded, newest for submissions, exact for jobs."""

from __future__ import annotations

import pytest
from support.statements import statements_of

from buildarena_api.routes.tasks import EXAMPLE
from buildarena_benchmark import TaskError, builtin_tasks, parse_custom_task
from buildarena_benchmark.tasks import task as task_module
from buildarena_pipeline.catalog.specs import JobSpec, SweepSpec
from buildarena_pipeline.catalog.tasks import TaskCatalog, TaskChangedError
from buildarena_pipeline.errors import PermanentError, SubmissionError
from buildarena_pipeline.runtime.scoring import task_of
from buildarena_store import UnknownIdError

OTHER = EXAMPLE.replace("final_mass: 200", "final_mass: 300")


@pytest.fixture
def queries(context):
    """Statements that were sent to the database."""
    with statements_of(context.store.database.engine) as seen:
        yield seen


def add(context, text: str) -> str:
    task = parse_custom_task(text, origin="task")
    context.tasks.add(task, text)
    return task.version


def test_the_newest_version_is_named_and_every_version_is_kept(context) -> None:
    old, new = add(context, EXAMPLE), add(context, OTHER)
    names = context.tasks.newest()
    assert list(names) == [*builtin_tasks(), "narrow-gap"]
    assert names["narrow-gap"].version == new
    fresh = TaskCatalog(context.store.tasks)
    for catalogue in (context.tasks, fresh):
        assert catalogue.exact("narrow-gap", old).scenario.cargo.final_mass == 200
        assert catalogue.exact("narrow-gap", new).scenario.cargo.final_mass == 300
        assert catalogue.exact("narrow-gap", "0" * 12) is None
        assert (
            catalogue.find("narrow-gap").current,
            catalogue.find("narrow-gap", old).current,
        ) == (
            True,
            False,
        )
    with pytest.raises(UnknownIdError, match="nowhere"):
        context.tasks.find("nowhere")


def test_the_same_content_is_stored_once(context) -> None:
    task = parse_custom_task(EXAMPLE, origin="task")
    assert context.tasks.add(task, EXAMPLE, owner=None)
    assert not context.tasks.add(task, EXAMPLE + "# again\n")
    assert len(context.store.tasks.versions("narrow-gap")) == 1


def test_a_built_in_tasks_name_is_taken() -> None:
    with pytest.raises(TaskError, match=r"task:1: name: support-1 is a built-in task"):
        parse_custom_task(EXAMPLE.replace("narrow-gap", "support-1"), origin="task")


def test_a_title_alone_does_not_change(context) -> None:
    add(context, EXAMPLE)
    text = EXAMPLE.replace("A bridge", "No bridge").replace("unit: mass units", "unit: kg")
    with pytest.raises(TaskChangedError, match="another title and indicator"):
        context.tasks.add(parse_custom_task(text, origin="task"), text)


def test_a_job_keeps_its_version_when_the_task_changes(context, submissions) -> None:
    spec = JobSpec(task="narrow-gap", model="builtin/idle")
    old = add(context, EXAMPLE)
    first, _ = submissions.submit_job(spec)
    new = add(context, OTHER)
    second, is_new = submissions.submit_job(spec)
    assert is_new
    assert (first.task_version, second.task_version) == (old, new)
    assert task_of(first, TaskCatalog(context.store.tasks)).version == old


def test_a_version_that_is_gone_is_a_fault_and_no_score(context, submissions) -> None:
    add(context, EXAMPLE)
    job, _ = submissions.submit_job(JobSpec(task="narrow-gap", model="builtin/idle"))
    with context.store.database.transaction() as connection:
        connection.exec_driver_sql("DELETE FROM tasks")
    with pytest.raises(PermanentError, match="submit it again"):
        task_of(job, TaskCatalog(context.store.tasks))


def test_unknown_tasks_are_refused_with_own_ones_among_the_choices(context, submissions) -> None:
    add(context, EXAMPLE)
    with pytest.raises(SubmissionError) as caught:
        submissions.plan(SweepSpec(tasks=["narrow-gap", "wide-gap"], models=["builtin/idle"]))
    (error,) = caught.value.issues
    assert error.path == "tasks[1]"
    assert {"narrow-gap", "support-1"} <= set(error.choices)


def test_the_database_is_asked_once_for_a_version_and_never_for_built_in_tasks(
    context, queries
) -> None:
    version = add(context, EXAMPLE)
    fresh = TaskCatalog(context.store.tasks)
    del queries[:]
    support = builtin_tasks()["support-1"]
    for _ in range(10):
        assert fresh.exact("support-1", support.version) is support
        assert fresh.named(["support-1", "lift-2"])["support-1"] is support
    assert queries == []
    tasks = {id(fresh.exact("narrow-gap", version)) for _ in range(10)}
    assert (len(tasks), len(queries)) == (1, 1)
    fresh.newest()
    assert len(queries) == 2


def test_a_changed_scorer_makes_a_new_version_of_an_own_task(
    context, submissions, monkeypatch
) -> None:
    old = add(context, EXAMPLE)
    job, _ = submissions.submit_job(JobSpec(task="narrow-gap", model="builtin/idle"))
    monkeypatch.setattr(task_module, "SCORER_VERSION", task_module.SCORER_VERSION + 1)
    updated = TaskCatalog(context.store.tasks)
    renewed = updated.newest()["narrow-gap"]
    assert renewed.version != old
    assert (
        updated.find("narrow-gap").task == renewed == updated.exact("narrow-gap", renewed.version)
    )
    with pytest.raises(PermanentError, match="submit it again"):
        task_of(job, updated)
    assert len(context.store.tasks.versions("narrow-gap")) == 2
    assert TaskCatalog(context.store.tasks).newest()["narrow-gap"] == renewed


@pytest.mark.parametrize("document", ["name: broken\n", EXAMPLE])
def test_a_row_that_is_no_task_of_its_name_is_left_out(context, submissions, document) -> None:
    context.store.tasks.add(name="broken", version="0" * 12, document=document)
    assert list(context.tasks.newest()) == list(builtin_tasks())
    with pytest.raises(SubmissionError, match="broken"):
        submissions.plan(SweepSpec(tasks=["broken"], models=["builtin/idle"]))
    with pytest.raises(UnknownIdError, match="broken"):
        context.tasks.find("broken")
