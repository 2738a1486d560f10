"""Briefing of an external agent when its session opens: the task, the rules and the tools."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Final

from pydantic import with_config

from buildarena_backend.agents.test_trials import describe_submission
from buildarena_backend.agents.workbench import MAX_BYTES
from buildarena_backend.journal.external_calls import IDLE_FOR
from buildarena_benchmark import Task
from buildarena_benchmark.environment import briefing as words_around

MAX_CALLS: Final = 2000
"""Calls a session may make."""
MAX_SESSION_BYTES: Final = 8 << 20
"""Bytes of a session's arguments and feedback together: 4 kB for each of its calls."""


@with_config(use_attribute_docstrings=True)
@dataclass(frozen=True, slots=True, kw_only=True)
class SessionLimits:
    """Limits of a session."""

    calls: int
    """Calls it may make."""
    session_bytes: int
    """Bytes of all arguments and answers."""
    call_bytes: int
    """Bytes of one call's arguments."""
    idle_s: int
    """Seconds without a call after which it is cancelled."""


LIMITS: Final = SessionLimits(
    calls=MAX_CALLS,
    session_bytes=MAX_SESSION_BYTES,
    call_bytes=MAX_BYTES,
    idle_s=int(IDLE_FOR.total_seconds()),
)


def briefing(task: Task, *, data_sheets: bool = True, worlds: int = 0) -> str:
    """Return all instructions of an agent for a task, except its tools.

    Args:
        data_sheets: Whether it is given the numbers of modules and world.
        worlds: Number of varied worlds in which its machine is scored.

    Returns:
        Markdown: how it plays, the statement, the frame, the rules, the limits, the modules.
    """
    return words_around.briefing(
        task,
        trials=describe_submission(task),
        guidelines=f"{_guidelines()}\n{words_around.describe_worlds(worlds)}",
        values={
            "calls": f"{LIMITS.calls:,}",
            "bytes": f"{LIMITS.session_bytes:,}",
            "call_bytes": f"{LIMITS.call_bytes:,}",
            "idle_hours": str(LIMITS.idle_s // 3600),
        },
        data_sheets=data_sheets,
    )


def briefing_digest(*, on_demand: bool = False, data_sheets: bool = True) -> str:
    """Return the hash of the text around a statement: results of different ones don't compare.

    Args:
        on_demand: Whether the task's modules are looked up instead of given.
        data_sheets: Whether it is given the numbers of modules and world.
    """
    return words_around.briefing_digest(
        describe_submission(None), _guidelines(), on_demand=on_demand, data_sheets=data_sheets
    )


@cache
def _guidelines() -> str:
    return resources.files(__package__).joinpath("guidelines.md").read_text(encoding="utf-8")
