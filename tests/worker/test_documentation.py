from __future__ import annotations

import re
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
from support.providers.scripted import Scripted, call
from support.stages import work

from buildarena_benchmark import builtin_tasks, parse_custom_task
from buildarena_pipeline.catalog.specs import JobSpec
from buildarena_pipeline.runtime.simulators.installed import announced, installed_simulators
from buildarena_worker.builtin.designs import DESIGNS
from buildarena_worker.session.messages import Completion

DOCS = Path(__file__).parents[2] / "docs"
GUIDE = (DOCS / "extending.md").read_text()
START = call("start", init_shift=[0, 0, 0], init_rotation=[0, 0, 0], note="")
BLOCK = call("attach_block_to", base_block="1", face="A", new_block="Small Wooden Block", note="")


def test_the_workflow_of_the_guide_works_as_it_stands(play, tmp_path: Path) -> None:
    source = python_of_guide("builder back")
    assert len(source.splitlines()) <= 45
    file = tmp_path / "builder_critic.py"
    file.write_text(source)
    model = Scripted(
        START,
        Completion(text="Done."),
        Completion(text="Too small."),
        BLOCK,
        Completion(text="Done."),
    )
    played = play(
        workflow="builder-critic",
        workflows={"builder-critic": f"{file}:BuilderAndCritic"},
        client=model,
    )
    assert played.suspended is not None, played.failure
    roles = [turn.role for turn in played.session.transcript.turns]
    assert roles == ["builder", "builder", "critic", "builder", "builder", "critic"]


@pytest.mark.parametrize("listed", ["inline", "on_demand"])
def test_what_it_builds_offers_the_tasks_modules(play, tmp_path: Path, listed: str) -> None:
    source = python_of_guide("builder back")
    file = tmp_path / "builder_critic.py"
    file.write_text(source)
    task = builtin_tasks()["mechanisms-3"]
    limits = task.constraints.model_copy(update={"module_list": listed})
    winch = call(
        "attach_block_to", base_block="1", face="A", new_block="Cog Large Unpowered", note=""
    )
    look = [call("describe_module", module="Cog Large Unpowered")] * (listed == "on_demand")
    model = Scripted(START, *look, winch, Completion(text="Done."))
    played = play(
        workflow="builder-critic",
        task=replace(task, constraints=limits),
        workflows={"builder-critic": f"{file}:BuilderAndCritic"},
        client=model,
    )
    actions = [action for turn in played.session.transcript.turns for action in turn.actions]
    assert all(action.ok for action in actions), actions
    assert len(played.session.machine.blocks) == 2


def test_the_simulator_of_the_guide_is_found_run_and_scored(
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
    context.store.workers.report(
        worker_id="simulate@here:1",
        kind="simulate",
        queues=["simulate.mujoco-fine"],
        host="here",
        pid=1,
        versions={**described.make(context.settings).versions, **announced(described)},
    )
    spec = JobSpec(task="lift-1", model="builtin/expert", simulator="mujoco-fine")
    job, _ = submissions.submit_job(spec)
    work(context)
    done = context.store.jobs.get(job.id)
    assert "/mujoco-fine-1/" in done.track
    assert done.outcome == "success"


def test_every_design_is_explained() -> None:
    text = (DOCS / "expert.md").read_text()
    for task in DESIGNS:
        assert f"| {task} |" in text


def test_the_greatest_indicators_are_told_as_they_are() -> None:
    _, _, table = (DOCS / "expert.md").read_text().partition("## Room above the expert")
    rows = re.findall(r"^\| ([a-z]+-\d) \| ([^|]+) \|", table, re.MULTILINE)
    greatest = {name: builtin_tasks()[name].ceiling for name, _ in rows}
    assert dict(rows) == {
        name: "none" if most is None else f"{most:,g}" for name, most in greatest.items()
    }


def test_the_guides_task_is_a_task() -> None:
    (text,) = re.findall(r"```yaml\n(name: narrow-gap.*?)```", GUIDE, re.DOTALL)
    task = parse_custom_task(text, origin="extending.md")
    assert (task.constraints.max_blocks, task.scorer) == (30, "support")


def python_of_guide(says: str) -> str:
    """The guide's program whose first line says this."""
    (source,) = re.findall(rf'```python\n("""[^\n]*{says}.*?)```', GUIDE, re.DOTALL)
    return source
