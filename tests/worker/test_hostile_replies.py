"""Models whose replies try to reach files, the network or other programs get nowhere."""

from __future__ import annotations

import itertools
import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from support.stages import work

from buildarena_pipeline.catalog.specs import JobSpec
from buildarena_worker import builtin
from buildarena_worker.builtin import expert
from buildarena_worker.session.messages import Completion, Request, ToolCall

LURES = (
    "../../../../etc/passwd",
    "/etc/shadow",
    "file:///etc/passwd",
    "http://127.0.0.1:9/steal?x=1",
    "$(touch /tmp/buildarena-pwned)",
    "`id`; rm -rf ~",
    "__import__('os').system('id')",
    "{{7*7}} ${7*7} %(x)s {0.__class__}",
    "!!python/object/apply:os.system ['id']",
    "'; DROP TABLE jobs; --",
    "<script src=http://127.0.0.1:9/x.js></script>",
    "\u0000\ud800\x1b[2J",
    "[bold]rich[/bold] [link=file:///etc/passwd]x[/link]",
)
TOOLS = ("open", "read_file", "python", "bash", "fetch", "import", "attach_block_to", "start")
REACHED = ("open", "socket.connect", "socket.getaddrinfo", "subprocess.Popen", "os.system")
ALLOWED = tuple(
    str(Path(folder).resolve())
    for folder in (sys.prefix, sys.base_prefix, Path(__file__).parents[2], "/proc", "/dev")
)
watching = False
seen: list[tuple[str, str]] = []


def _watch(event: str, arguments: tuple[object, ...]) -> None:
    if not watching or event not in REACHED:
        return
    target = str(arguments[0])
    writes = event == "open" and set(str(arguments[1] or "r")) & set("wax+")
    if event != "open" or writes or not target.startswith(ALLOWED):
        seen.append((event, str(arguments)[:200]))


# A hook can't be taken out again: this one looks only while a session plays.
sys.addaudithook(_watch)


def liar(request: Request) -> Completion:
    """Says lures only, and calls tools that there are and that there are not with them."""
    number = len(request.messages) * 7 + sum(len(m.text) for m in request.messages)
    lure = LURES[number % len(LURES)]
    name = TOOLS[number % len(TOOLS)]
    arguments = {"path": lure, "base_block": lure, "face": lure, "new_block": lure, "note": lure}
    call = ToolCall(id=lure, name=name, arguments=arguments if number % 3 else lure)
    plan = (
        f"<building_plan><overall_structure>{lure}</overall_structure><sub_structure>"
        f"<name>{lure}</name><description>{lure}</description></sub_structure></building_plan>"
    )
    return Completion(text=f"{plan}\n{lure}", calls=(call,) if request.tools else ())


def spiced_expert() -> object:
    """The expert, whose every text and note carries a lure."""
    lures = itertools.cycle(LURES)

    def reply(request: Request) -> Completion:
        said = expert.reply(request)
        calls = tuple(
            replace(call, arguments={**call.arguments, "note": next(lures)})
            if call.name in {"start", "attach_block_to", "connect_blocks"}
            else call
            for call in said.calls
        )
        # The controller's answer is a program: only what stands around it may be spiced. Guidance
        # begins with a step's number.
        parts = (said.text, next(lures)) if said.text[:1].isdigit() else (next(lures), said.text)
        return replace(said, text="\n".join(parts), calls=calls)

    return reply


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("workflow", ["five-role", "guidance-builder", "builder"])
@pytest.mark.parametrize("task", ["support-2", "transport-1"])
def test_lures_reach_nothing(play, monkeypatch, workflow, task) -> None:
    global watching  # noqa: PLW0603 - the hook is as global
    monkeypatch.setitem(builtin.MODELS, "idle", liar)
    play("builtin/idle", task=task, workflow=workflow)  # loads what is loaded once
    seen.clear()
    watching = True
    try:
        played = play("builtin/idle", task=task, workflow=workflow)
    finally:
        watching = False
    assert seen == []
    assert type(played.failure).__name__ == "Failed"


def test_lures_in_a_good_machine_go_the_whole_way_as_text(
    context, submissions, monkeypatch, tmp_path
) -> None:
    monkeypatch.setitem(builtin.MODELS, "expert", spiced_expert())
    job, _ = submissions.submit_job(
        JobSpec(task="lift-1", model="builtin/expert", simulator="mujoco")
    )
    work(context)
    job = context.store.jobs.get(job.id)
    assert job.outcome == "success", job.detail
    transcript = context.artifacts.get(context.store.jobs.artifacts(job.id)["transcript"]).decode()
    assert "etc/passwd" in transcript
    written = {path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file()}
    assert all(re.fullmatch(r"data/artifacts/..\/[0-9a-f]{64}", str(path)) for path in written)
    assert not Path("/tmp/buildarena-pwned").exists()
