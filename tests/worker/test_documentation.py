from __future__ import annotations

import re
from pathlib import Path

from scripted import Scripted, call

from buildarena_benchmark import parse_custom_task
from buildarena_worker.builtin.designs import DESIGNS
from buildarena_worker.session.messages import Reply

DOCS = Path(__file__).parents[2] / "docs"
START = call("start", init_shift=[0, 0, 0], init_rotation=[0, 0, 0], note="")
BLOCK = call("attach_block_to", base_block="1", face="A", new_block="Small Wooden Block", note="")


def test_the_workflow_of_the_guide_works_as_it_stands(play, tmp_path: Path) -> None:
    (source,) = re.findall(r"```python\n(.*?)```", (DOCS / "extending.md").read_text(), re.DOTALL)
    assert len(source.splitlines()) <= 45
    file = tmp_path / "builder_critic.py"
    file.write_text(source)
    model = Scripted(
        START, Reply(text="Done."), Reply(text="Too small."), BLOCK, Reply(text="Done.")
    )
    played = play(
        workflow="builder-critic",
        workflows={"builder-critic": f"{file}:BuilderAndCritic"},
        client=model,
    )
    assert played.suspended is not None, played.failure
    roles = [turn.role for turn in played.session.transcript.turns]
    assert roles == ["builder", "builder", "critic", "builder", "builder", "critic"]


def test_every_design_is_explained() -> None:
    text = (DOCS / "expert.md").read_text()
    for task in DESIGNS:
        assert f"| {task} |" in text


def test_the_guides_task_is_a_task() -> None:
    guide = (DOCS / "extending.md").read_text()
    (text,) = re.findall(r"```yaml\n(name: narrow-gap.*?)```", guide, re.DOTALL)
    task = parse_custom_task(text, origin="extending.md")
    assert (task.constraints.max_blocks, task.scorer) == (30, "support")
