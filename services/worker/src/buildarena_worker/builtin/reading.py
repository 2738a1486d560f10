"""Extraction of role, task and progress from requests, for built-in models."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from buildarena_benchmark.environment.tools import LOOKUPS
from buildarena_benchmark.experts.design import PastTrial
from buildarena_worker.session.messages import Message, Request

_ROLE = re.compile(r"^# Role: (\S+)", re.MULTILINE)
_TASK = re.compile(r"^# Task: (\S+)", re.MULTILINE)
_PART = re.compile(r"^## (?:Sub-structure|Refinement of): (.+)$", re.MULTILINE)
_ASSEMBLY = re.compile(r"^## Assembly$", re.MULTILINE)
_REFINEMENT = re.compile(r"^## Refinement of: ", re.MULTILINE)
_STEP = re.compile(r"^\[guidance\] (\d+)\. ", re.MULTILINE)
_MEASURED = re.compile(r"Measured: (.*?)\.(?: |$)", re.MULTILINE)
_FIGURE = re.compile(r"(\w+) (-?[\d.]+(?:e[+-]?\d+)?)(?=,|$)")
_BUILDER = re.compile(r"^\[builder\] ", re.MULTILINE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """A request as a built-in model understands it.

    Attributes:
        role: Role from the system message, "" when it names none.
        task: Task name.
        part: Sub-structure that the request is about, if any.
        assembling: Whether the sub-structures are being put together.
        refining: Whether a built machine is being corrected.
        own_turns: Replies that this role gave before, as far as it knows.
        own_actions: Tool calls of this role before, without lookups of modules.
        own_lookups: Lookups of modules by this role before.
        has_drawing: Whether it works from a drawing.
        builder_turns: Replies of the builder that this role has read.
        trials: Programs of this role whose trials were reported, with their figures.
        may_keep: Whether the last message offers to keep the control that was tried.
    """

    role: str
    task: str
    part: str | None
    assembling: bool
    refining: bool
    own_turns: int
    own_actions: int
    own_lookups: int
    has_drawing: bool
    builder_turns: int
    trials: Sequence[PastTrial]
    may_keep: bool


def read_situation(request: Request) -> Situation:
    """Find the cues that our prompts carry in their headings."""
    system = "\n".join(m.text for m in request.messages if m.role == "system")
    received = [m.text for m in request.messages if m.role == "user"]
    opening = received[0] if received else ""
    own = [m for m in request.messages if m.role == "assistant"]
    calls = [call.name for message in own for call in message.calls]
    lookups = sum(name in LOOKUPS for name in calls)
    # A builder reads only the current steps; their numbers include the earlier ones.
    steps = [int(number) for text in received for number in _STEP.findall(text)]
    before = steps[-1] - 1 if steps and _first(_ROLE, system) == "builder" else 0
    return Situation(
        role=_first(_ROLE, system),
        task=_first(_TASK, opening),
        part=_first(_PART, opening).strip() or None,
        assembling=_ASSEMBLY.search(opening) is not None,
        refining=_REFINEMENT.search(opening) is not None,
        own_turns=len(own) + (before + 1 if steps else 0),
        own_actions=len(calls) - lookups + before,
        own_lookups=lookups,
        has_drawing="Drawing of " in opening,
        builder_turns=sum(len(_BUILDER.findall(text)) for text in received),
        trials=_trials(request.messages),
        may_keep=bool(received) and "KEEP" in received[-1],
    )


def _trials(messages: Sequence[Message]) -> list[PastTrial]:
    """Return the programs whose trial was reported, each with its figures."""
    trials = []
    for answer, result in pairwise(messages):
        figures = figures_of(result.text)
        if answer.role == "assistant" and result.role == "user" and figures:
            # The keys that it presses; none if it is a program in Lua.
            keys = json.loads(answer.text) if answer.text.startswith("{") else {}
            trials.append(PastTrial(program=keys, measured=figures))
    return trials


def figures_of(text: str) -> dict[str, float]:
    """Return the figures in the text of a trial's result, by name; none in any other text."""
    return {name: float(value) for name, value in _FIGURE.findall(_first(_MEASURED, text))}


def _first(pattern: re.Pattern[str], text: str) -> str:
    match = pattern.search(text)
    return match.group(1) if match else ""
