"""The page of what models see: one whole session of each category, as its roles read it.

`make docs` adds it to the site as what-a-model-sees.md.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from collections.abc import Set as AbstractSet
from datetime import UTC, datetime
from functools import cache
from itertools import groupby

from support.player import Player
from support.providers.scripted import Recording

from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_backend.journal.transcript import Turn
from buildarena_backend.settings import Settings
from buildarena_benchmark import CANARY
from buildarena_worker.session.messages import Message

SESSIONS = (("support-1", 0), ("transport-1", 2), ("lift-3", 0))
SESSIONS += (("mechanisms-7", 0), ("flight-2", 0))
"""Tasks, and how many simulated trials each session is told about."""
HEAD = """# What a model sees

<!-- {canary} -->

A session of each category in the default workflow, played by `builtin/expert`, with what each role
reads: its system message, what it reads first, and then what is new in each request. Replies are
indented. The expert's solutions are left out: of what it says, and of what is read of it later, a
beginning stands here. `make docs` writes this page.
"""
BEGINNING = 2
"""Lines of a solution, and requests of a builder, that stand here."""
FORM = re.compile(r"^\s*(</?\w+>)?\s*$")
"""Lines that every solution has."""
LISTED = re.compile(r"^\s*(- )?\d+\.? \S")
"""A step of a draft, or a block of a machine."""


@cache
def page() -> str:
    """The whole page."""
    parts = [HEAD.format(canary=CANARY)]
    for task, trials in SESSIONS:
        parts.append(f"## {task}\n")
        parts.extend(_session(task, trials))
    return "\n".join(parts).rstrip() + "\n"


def _session(task: str, trials: int) -> Iterator[str]:
    model = Recording()
    rollouts = [_rollout(number) for number in range(trials)]
    usual = Settings.model_fields["worlds"].default
    played = Player()("builtin/expert", task=task, client=model, rollouts=rollouts, worlds=usual)
    read: dict[tuple[str, str | None, str], int] = {}
    requests: Counter[tuple[str, str | None, str]] = Counter()
    turns = played.session.transcript.turns
    solution = {line.strip() for turn in turns for line in _words(turn) if not FORM.match(line)}
    for turn, request in zip(turns, model.requests, strict=True):
        where = (turn.stage, turn.sub_structure, turn.role)
        requests[where] += 1
        if requests[where] > BEGINNING and turn.role == "builder":
            if requests[where] == BEGINNING + 1:
                yield "Further requests of this builder are like these.\n"
            read[where] = len(request.messages)
            continue
        part = f", {turn.sub_structure}" if turn.sub_structure else ""
        yield f"### {turn.stage}{part}: {turn.role}\n"
        before = read.get(where, 0)
        if not before and request.tools:
            yield f"Tools: {', '.join(tool.name for tool in request.tools)}.\n"
        for message in request.messages[before:]:
            if message.role != "assistant":
                yield _block(message, solution)
        read[where] = len(request.messages)
        yield "\n".join(f"    {line}" for line in _left_out(_words(turn), solution)) + "\n"


def _words(turn: Turn) -> list[str]:
    words = [turn.text] if turn.text else []
    words += [f"{action.name} {action.arguments}" for action in turn.actions]
    return "\n".join(words).splitlines()


def _block(message: Message, solution: AbstractSet[str]) -> str:
    kind = f"answer of {message.tool}" if message.role == "tool" else message.role
    text = "\n".join(_left_out(message.text.splitlines(), solution))
    return f"*{kind}*\n\n```text\n{text}\n```\n"


def _left_out(lines: Iterable[str], solution: AbstractSet[str]) -> Iterator[str]:
    """Lines without most of what is the expert's: of each passage its beginning."""
    for is_solution, passage in groupby(
        lines, lambda line: line.strip() in solution or LISTED.match(line) is not None
    ):
        kept = list(passage)
        if is_solution and len(kept) > BEGINNING + 1:
            yield from kept[:BEGINNING]
            yield f"[{len(kept) - BEGINNING} lines of the solution are left out]"
        else:
            yield from kept


def _rollout(number: int) -> RolloutRecord:
    now = datetime(2026, 1, 1, tzinfo=UTC)
    figures = {"success": False, "indicator": 4.0 + number, "metrics": {}, "flags": []}
    tried = {"engine": "mujoco", "machine_hash": "0" * 64, "controls": None, "final": False}
    trace = [[float(t), 0.0, min(float(t), 4.0), 1.0] for t in range(31)]
    ran = {"versions": {}, "wall_s": 0.1, "created_at": now, "finished_at": now}
    kept = {"trajectory_hash": None, "trace": trace}
    return RolloutRecord(number=number, **figures, **tried, **kept, **ran)
