"""Tasks that users uploaded, from submission to score, and what the guide on extending shows."""

import json
import re
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest
from support.jobs import report_worker
from support.providers.scripted import Scripted, call
from support.stages import assert_verified, work

from buildarena_api.routes.tasks import EXAMPLE
from buildarena_backend.agents.sessions import ExternalSessions
from buildarena_backend.catalog.specs import JobSpec
from buildarena_backend.jobs.job import Job
from buildarena_backend.trials.installed_simulators import announced, installed_simulators
from buildarena_benchmark import parse_custom_task
from buildarena_benchmark.experts import expert_designs
from buildarena_worker.session.messages import Completion

BRIDGE = Path(__file__).parents[2] / "examples" / "tasks" / "suspension-bridge.yaml"
SUSPENSION = json.loads((Path(__file__).parents[1] / "data/suspension-bridge.json").read_text())
OTHER = EXAMPLE.replace("final_mass: 200", "final_mass: 300")


@pytest.fixture
def finish(context) -> Callable[[str], Job]:
    """Works on a job until it has ended."""

    def finish_job(job_id: str) -> Job:
        work(context)
        return context.store.jobs.get(job_id)

    return finish_job


@pytest.fixture
def agent_plays(context) -> Callable[..., Job]:
    """Builds the expert's bridge of another task, as an external agent, and submits it."""

    def play_task(task: str, design: str = "support-1", seed: int = 0) -> Job:
        sessions = ExternalSessions(context)
        job = sessions.open(task=task, agent="me", seed=seed, simulator="mujoco")[0].job
        for tool, arguments in next(iter(expert_designs()[design](0).parts.values())).actions:
            done = sessions.call(job.id, machine="main", tool=tool, arguments=arguments)
            assert done.ok, done.feedback
        return sessions.submit(job.id)

    return play_task


def add(context, text: str) -> str:
    task = parse_custom_task(text, origin="task")
    context.tasks.add(task, text)
    return task.version


@pytest.mark.ci
def test_an_agents_bridge_is_simulated_scored_and_verified(context, agent_plays, finish) -> None:
    version = add(context, EXAMPLE)
    job = finish(agent_plays("narrow-gap").id)
    assert (job.outcome, job.success, job.indicator) == ("success", True, 200.0)
    assert job.manifest["task"] == {"name": "narrow-gap", "version": version}
    assert_verified(context, job.id)


@pytest.mark.ci
def test_a_job_in_work_is_tried_and_verified_in_its_version(context, agent_plays, finish) -> None:
    add(context, EXAMPLE)
    old = agent_plays("narrow-gap")
    add(context, OTHER)
    new = agent_plays("narrow-gap", seed=1)
    assert (finish(old.id).indicator, finish(new.id).indicator) == (200.0, 300.0)
    for job in (old, new):
        assert_verified(context, job.id)


def test_what_a_task_asks_of_modules_is_checked(context, agent_plays) -> None:
    add(context, EXAMPLE.replace("scenario:", "constraints: {min_modules: {Winch: 2}}\nscenario:"))
    job = agent_plays("narrow-gap")
    assert (job.outcome, job.reason) == ("construction_failed", "constraint_violated")
    assert "0 of Winch" in job.detail


@pytest.mark.ci
def test_the_papers_suspension_bridge_is_built_from_parts_and_scored(context, finish) -> None:
    add(context, BRIDGE.read_text())
    sessions = ExternalSessions(context)
    job = sessions.open(task="suspension-bridge", agent="me", seed=0, simulator="mujoco")[0].job
    for machine, actions in SUSPENSION["with ropes"].items():
        for tool, arguments in actions:
            done = sessions.call(job.id, machine=machine, tool=tool, arguments=arguments)
            assert done.ok, done.feedback
    job = finish(sessions.submit(job.id).id)
    assert_verified(context, job.id)
    assert (job.outcome, job.flags) == ("success", [])
    assert 900 < job.indicator < 1500


DOCS = Path(__file__).parents[2] / "docs"
GUIDE = (DOCS / "extending.md").read_text()
START = call("start", init_shift=[0, 0, 0], init_rotation=[0, 0, 0], note="")
BLOCK = call("attach_block_to", base_block="1", face="A", new_block="Small Wooden Block", note="")


def test_the_workflow_of_the_guide_works_as_it_stands(play, tmp_path: Path) -> None:
    source = python_of_guide("builder back")
    assert len(source.splitlines()) <= 45
    file = tmp_path / "builder_critic.py"
    file.write_text(source)
    done, small = Completion(text="Done."), Completion(text="Too small.")
    model = Scripted(START, done, small, BLOCK, done)
    name = "builder-critic"
    known = {name: f"{file}:BuilderAndCritic"}
    played = play(workflow=name, workflows=known, client=model)
    assert played.suspended is not None, played.failure
    roles = [turn.role for turn in played.session.transcript.turns]
    assert roles == ["builder", "builder", "critic", "builder", "builder", "critic"]


def test_the_guides_simulator_runs_and_is_scored(
    context, submissions, tmp_path: Path, monkeypatch
) -> None:
    (tmp_path / "mujoco_fine.py").write_text(python_of_guide("half the time step, as"))
    (project,) = re.findall(r"```toml\n([^`]*buildarena\.simulators.*?)```", GUIDE, re.DOTALL)
    registered = tomllib.loads(project)["project"]["entry-points"]["buildarena.simulators"]
    metadata = tmp_path / "mujoco_fine-1.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: mujoco-fine\nVersion: 1\n")
    lines = "".join(f"{name} = {value}\n" for name, value in registered.items())
    (metadata / "entry_points.txt").write_text(f"[buildarena.simulators]\n{lines}")
    monkeypatch.syspath_prepend(tmp_path)
    described = installed_simulators()["mujoco-fine"]
    versions = {**described.make(context.settings).versions, **announced(described)}
    report_worker(context, "simulate@here:1", "simulate.mujoco-fine", versions=versions)
    spec = JobSpec(task="lift-1", model="builtin/expert", simulator="mujoco-fine")
    job, _ = submissions.submit_job(spec)
    work(context)
    done = context.store.jobs.get(job.id)
    assert "/mujoco-fine-1/" in done.track
    assert done.outcome == "success"


def python_of_guide(says: str) -> str:
    """The guide's program whose first line says this."""
    (source,) = re.findall(rf'```python\n("""[^\n]*{says}.*?)```', GUIDE, re.DOTALL)
    return source
