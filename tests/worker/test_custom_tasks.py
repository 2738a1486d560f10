"""Tasks that users uploaded, from submission to score and verification, on the real database."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from support.machines.suspension_bridge import suspension_bridge
from support.stages import work

from buildarena_api.routes.tasks import EXAMPLE
from buildarena_benchmark import builtin_tasks, parse_custom_task
from buildarena_pipeline.agents.sessions import ExternalSessions
from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.catalog.prompt_packs import PromptPacks
from buildarena_pipeline.catalog.specs import JobSpec
from buildarena_pipeline.submission.submission import Submissions
from buildarena_store import Job
from buildarena_worker.builtin.designs import DESIGNS
from buildarena_worker.session.host import ReplayHost
from buildarena_worker.session.session import Session
from buildarena_worker.wiring import verifier

BRIDGE = Path(__file__).parents[2] / "examples" / "tasks" / "suspension-bridge.yaml"
OTHER = EXAMPLE.replace("final_mass: 200", "final_mass: 300")


@pytest.fixture
def finish(context) -> Callable[[str], Job]:
    """Works on a job until it has ended."""

    def finish_job(job_id: str) -> Job:
        work(context)
        return context.store.jobs.get(job_id)

    return finish_job


@pytest.fixture
def submit(context) -> Callable[..., Job]:
    def submit_job(**spec: object) -> Job:
        given = {"model": "builtin/random", "simulator": "mujoco", **spec}
        job, _ = Submissions(context, load_registry()).submit_job(JobSpec.model_validate(given))
        return job

    return submit_job


@pytest.fixture
def play(context) -> Callable[..., Job]:
    """Builds the expert's bridge of another task, as an external agent, and submits it."""

    def play_task(task: str, design: str = "support-1", seed: int = 0) -> Job:
        sessions = ExternalSessions(context)
        job = sessions.open(task=task, agent="me", seed=seed, simulator="mujoco").job
        for tool, arguments in next(iter(DESIGNS[design](0).parts.values())).actions:
            done = sessions.call(job.id, machine="main", tool=tool, arguments=arguments)
            assert done.ok, done.feedback
        return sessions.submit(job.id)

    return play_task


def add(context, text: str) -> str:
    task = parse_custom_task(text, origin="task")
    context.tasks.add(task, text)
    return task.version


def own(name: str, builtin: str, **changes: object) -> str:
    document = dict(builtin_tasks()[builtin].as_document())
    return yaml.safe_dump({**document, "name": name, "category": "own", **changes})


def assert_verified(context, job: Job) -> None:
    report = verifier(context).verify(job.id).as_document()
    assert report["ok"], [check for check in report["checks"] if not check["ok"]]


@pytest.mark.ci
def test_an_agents_bridge_is_simulated_scored_and_verified(context, play, finish) -> None:
    version = add(context, EXAMPLE)
    job = finish(play("narrow-gap").id)
    assert (job.outcome, job.success, job.indicator) == ("success", True, 200.0)
    assert job.manifest["task"] == {"name": "narrow-gap", "version": version}
    assert_verified(context, job)


@pytest.mark.ci
def test_a_job_in_work_is_tried_and_verified_with_its_own_version(context, play, finish) -> None:
    add(context, EXAMPLE)
    old = play("narrow-gap")
    add(context, OTHER)
    new = play("narrow-gap", seed=1)
    assert (finish(old.id).indicator, finish(new.id).indicator) == (200.0, 300.0)
    for job in (old, new):
        assert_verified(context, context.store.jobs.get(job.id))


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("level", ["car-1", "catapult-8", "delivery-1"])
def test_the_expert_plays_levels_of_besiegefield(context, submit, finish, level) -> None:
    name = f"besiegefield-{level}"
    add(context, (BRIDGE.parent / "besiegefield" / f"{name}.yaml").read_text())
    job = finish(submit(task=name, model="builtin/expert", workflow="builder").id)
    assert (job.outcome, job.success) == ("success", True), job.detail
    assert_verified(context, job)


def test_what_a_task_asks_of_modules_is_checked(context, play) -> None:
    add(context, EXAMPLE.replace("scenario:", "constraints: {min_modules: {Winch: 2}}\nscenario:"))
    job = play("narrow-gap")
    assert (job.outcome, job.reason) == ("construction_failed", "constraint_violated")
    assert "0 of Winch" in job.detail


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("model", ["builtin/expert", "builtin/random", "builtin/idle"])
@pytest.mark.parametrize("workflow", ["five-role", "guidance-builder", "builder"])
def test_built_in_models_end_with_a_score(context, submit, finish, model, workflow) -> None:
    add(context, EXAMPLE)
    job = finish(submit(task="narrow-gap", model=model, workflow=workflow).id)
    assert job.outcome in {"construction_failed", "unsuccessful"}, job.detail
    assert (job.success, job.indicator) == (False, 0.0)
    assert_verified(context, job)


def test_the_expert_says_that_it_has_no_design(context, submit, finish) -> None:
    add(context, EXAMPLE)
    job = finish(submit(task="narrow-gap", model="builtin/expert").id)
    assert (job.outcome, job.reason) == ("construction_failed", "plan_unreadable")
    assert "I have no design for narrow-gap" in job.detail


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("builtin", ["transport-2", "support-2", "lift-1", "lift-3"])
@pytest.mark.parametrize(
    "more", [{"one_shot": True}, {"closed_loop": {"rounds": 2, "analyst": True}}]
)
def test_every_kind_of_task_and_variant_ends_with_a_score(
    context, submit, finish, builtin, more
) -> None:
    scenario = dict(builtin_tasks()[builtin].as_document()["scenario"]) | {"duration_s": 13}
    add(context, own("mine", builtin, scenario=scenario))
    job = finish(submit(task="mine", **more).id)
    assert job.outcome in {"construction_failed", "unsuccessful", "success"}, job.detail
    assert_verified(context, job)


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("builtin", ["transport-1", "transport-2", "support-1", "lift-1", "lift-2"])
def test_a_trial_that_tracks_one_block_only_is_scored(context, play, finish, builtin) -> None:
    scenario = dict(builtin_tasks()[builtin].as_document()["scenario"])
    add(context, own("mine", builtin, scenario={**scenario, "tracked_blocks": ["1"]}))
    job = finish(play("mine", builtin).id)
    assert job.outcome in {"unsuccessful", "success"}, job.detail
    assert_verified(context, job)


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("roped", [True, False])
def test_the_papers_suspension_bridge_is_built_from_parts_and_scored(
    context, finish, roped
) -> None:
    add(context, BRIDGE.read_text())
    sessions = ExternalSessions(context)
    job = sessions.open(task="suspension-bridge", agent="me", seed=0, simulator="mujoco").job
    for machine, actions in suspension_bridge(roped=roped).items():
        for tool, arguments in actions:
            done = sessions.call(job.id, machine=machine, tool=tool, arguments=arguments)
            assert done.ok, done.feedback
    job = finish(sessions.submit(job.id).id)
    assert_verified(context, job)
    if roped:
        assert (job.outcome, job.flags) == ("success", [])
        assert 900 < job.indicator < 1500
    else:
        assert (job.outcome, job.reason) == ("construction_failed", "constraint_violated")
        assert "0 of Winch" in job.detail


def test_a_prompt_pack_without_the_task_uses_the_tasks_own_words() -> None:
    pack = replace(PromptPacks().load("default"), statements={"support-1": "Of another task."})
    task = parse_custom_task(EXAMPLE, origin="task")
    host = ReplayHost(entries=[], rollouts=[], limits={}, load_trajectory={}.__getitem__)
    session = Session(task=task, seed=0, model_config={}, pack=pack, host=host)
    assert session.statement == task.statement.strip()
