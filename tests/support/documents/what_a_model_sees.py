"""Writes docs/what-a-model-sees.md: one whole session of each category, as its roles read it.

Run by `make what-a-model-sees` after an intended change of prompts, statements or answers; a test
compares the file with what sessions say now.
"""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from support.player import Player
from support.providers.scripted import Recording

from buildarena_store import RolloutRecord
from buildarena_worker.session.messages import Message
from buildarena_worker.workflow.rounds import Loop

PAGE = Path(__file__).parents[3] / "docs" / "what-a-model-sees.md"
SESSIONS = (
    ("support-1", 0),
    ("transport-1", 2),
    ("lift-3", 0),
    ("mechanisms-4", 0),
    ("flight-2", 0),
)
"""Tasks, and how many simulated trials each session is told about."""

HEAD = """# What a model sees

One whole session of each category in the default workflow, played by `builtin/expert`, with
everything that each role reads: its system message, what it reads first, and then what is new in
each request. Replies are indented. `make what-a-model-sees` writes this page.
"""


def page() -> str:
    """The whole page."""
    parts = [HEAD]
    for task, trials in SESSIONS:
        parts.append(f"## {task}\n")
        parts.extend(_session(task, trials))
    return "\n".join(parts).rstrip() + "\n"


def _session(task: str, trials: int) -> Iterator[str]:
    model = Recording()
    rollouts = [_rollout(number) for number in range(trials)]
    played = Player()("builtin/expert", task=task, client=model, rollouts=rollouts, loop=Loop())
    read: dict[tuple[str, str | None, str], int] = {}
    for turn, request in zip(played.session.transcript.turns, model.requests, strict=True):
        where = (turn.stage, turn.sub_structure, turn.role)
        part = f", {turn.sub_structure}" if turn.sub_structure else ""
        yield f"### {turn.stage}{part}: {turn.role}\n"
        before = read.get(where, 0)
        if not before and request.tools:
            yield f"Tools: {', '.join(tool.name for tool in request.tools)}.\n"
        for message in request.messages[before:]:
            if message.role != "assistant":
                yield _block(message)
        read[where] = len(request.messages)
        words = [turn.text] if turn.text else []
        words += [f"{action.name} {action.arguments}" for action in turn.actions]
        yield "\n".join(f"    {line}" for line in "\n".join(words).splitlines()) + "\n"


def _block(message: Message) -> str:
    kind = f"answer of {message.tool}" if message.role == "tool" else message.role
    return f"*{kind}*\n\n```text\n{message.text}\n```\n"


def _rollout(number: int) -> RolloutRecord:
    now = datetime(2026, 1, 1, tzinfo=UTC)
    return RolloutRecord(
        number=number,
        final=False,
        engine="mujoco",
        machine_hash="0" * 64,
        controls=None,
        success=False,
        indicator=4.0 + number,
        metrics={},
        flags=[],
        trajectory_hash=None,
        trace=[[float(t), 0.0, min(float(t), 4.0), 1.0] for t in range(31)],
        versions={},
        wall_s=0.1,
        created_at=now,
        finished_at=now,
    )


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
