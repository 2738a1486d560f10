"""What an external agent reads when its session opens: the task as one who plays alone has it.

A task's statement is written once, for models in workflows. What differs for an agent that brings
its own loop (it writes its own key presses and has one trial) is said around it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib import resources
from string import Template
from typing import Final

from buildarena_benchmark import Task
from buildarena_geometry import load_catalogue
from buildarena_geometry.feedback.modules import modules_text
from buildarena_geometry.feedback.words import counted
from buildarena_pipeline.agents.workbench import ASSEMBLY, MAIN, MAX_BYTES
from buildarena_store.jobs.external_calls import IDLE_FOR

MAX_CALLS: Final = 2000
"""Calls a session may make."""
MAX_SESSION_BYTES: Final = 8 << 20
"""What a session's arguments and feedback may have together: 4 kB for each of its calls."""
_CONTROL: Final = {
    "agent": (
        "You write the key presses yourself, before you submit: bind a key to each action that "
        "shall be used with `change_control_key`, and say when which key is held with "
        "`add_control_sequence`, both on the machine that is simulated. An assembly keeps the "
        "bindings of its sub-structures and has a sequence of its own."
    ),
    "held": "You need not bind any key: every water cannon fires from t = {from_s:g} s on.",
    "none": "No key is pressed in this trial, so you need not bind any.",
}

_CHECKS: Final = {
    "always": (
        "There is more than the starting block. Joints that hold and connectors join every part to "
        "the first starting block. At most {own} blocks in a sub-structure, {all} in all."
    ),
    "modules": "Only the modules listed below.",
    "least": "At least {count} x {name}.",
    "wheels": "At least {count} powered wheels.",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionLimits:
    """How much a session may do.

    Attributes:
        calls: Calls it may make.
        session_bytes: Bytes of all arguments and answers.
        call_bytes: Bytes of one call's arguments.
        idle_s: Seconds without a call after which it is cancelled.
    """

    calls: int
    session_bytes: int
    call_bytes: int
    idle_s: int


LIMITS: Final = SessionLimits(
    calls=MAX_CALLS,
    session_bytes=MAX_SESSION_BYTES,
    call_bytes=MAX_BYTES,
    idle_s=int(IDLE_FOR.total_seconds()),
)


def briefing(task: Task) -> str:
    """All that an agent must know to play a task, but for its tools.

    Args:
        task: The task.

    Returns:
        Markdown: how it plays, the statement, the frame, the rules, the limits, the modules.
    """
    return _template().substitute(
        task=task.name,
        control=_CONTROL[task.control].format(from_s=task.scenario.control.from_s),
        statement=task.statement.strip(),
        sub_structures=_sub_structures(task),
        main=MAIN,
        assembly=ASSEMBLY,
        checks=_checks(task),
        calls=f"{LIMITS.calls:,}",
        bytes=f"{LIMITS.session_bytes:,}",
        call_bytes=f"{LIMITS.call_bytes:,}",
        idle_hours=LIMITS.idle_s // 3600,
        modules=modules_text(load_catalogue(), task.constraints.modules),
    )


@cache
def briefing_digest() -> str:
    """Hash of the words around a statement: results of different ones don't compare."""
    words = [_template().template, *_CONTROL.values(), *_CHECKS.values()]
    return sha256("\0".join(words).encode()).hexdigest()


@cache
def _template() -> Template:
    return Template(
        resources.files(__package__).joinpath("briefing.md").read_text(encoding="utf-8").strip()
        + "\n"
    )


def _sub_structures(task: Task) -> str:
    fewest, most = task.constraints.min_sub_structures, task.constraints.max_sub_structures
    if fewest == most:
        return f"exactly {counted(most, 'sub-structure')}"
    return f"{fewest} to {most} sub-structures"


def _checks(task: Task) -> str:
    limits = task.constraints
    checks = [_CHECKS["always"].format(own=limits.max_blocks, all=limits.most_blocks)]
    if limits.modules is not None:
        checks.append(_CHECKS["modules"])
    checks += [
        _CHECKS["least"].format(count=count, name=name)
        for name, count in limits.min_modules.items()
    ]
    if limits.min_wheels:
        checks.append(_CHECKS["wheels"].format(count=limits.min_wheels))
    return " ".join(checks)
