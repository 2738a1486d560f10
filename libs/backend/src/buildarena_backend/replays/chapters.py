"""Parts of a replay, and limits on their size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from buildarena_geometry import Block, Difference, Machine, Refused, step

MAX_PARTS_TOLD: Final = 100_000
"""Parts in all steps together: a session that moves large assemblies about could fill gigabytes."""
MAX_WORK: Final = 5_000_000
"""Parts of the machine, summed over its steps: what doing them again may take."""

Kind = Literal["machine", "sub_structure", "assembly"]
Turn = Mapping[str, Any]
"""A turn as transcripts keep it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayStep:
    """An action as it was requested, and its result in the geometry library.

    Attributes:
        turn: Place of its turn in the transcript; None for actions of the session itself.
        action: Name of the tool.
        accepted: Whether it was carried out.
        reason: Refusal class; None if it was accepted.
        text: Reason for its refusal; None if it was accepted.
        attempted: The blocks where a refused action would have put them, if that is known.
    """

    turn: int | None
    action: str
    arguments: Any
    accepted: bool
    reason: str | None = None
    text: str | None = None
    difference: Difference = field(default_factory=Difference)
    attempted: tuple[Block, ...] = ()


@dataclass(slots=True, kw_only=True)
class Chapter:
    """Construction of one machine: a sub-structure, the assembly, or the only one.

    Attributes:
        name: The sub-structure's name; that of what it is for the others.
        machine: The machine after the last step.
    """

    name: str
    kind: Kind
    machine: Machine
    steps: list[ReplayStep] = field(default_factory=list)


@dataclass(frozen=True, slots=True, kw_only=True)
class Replay:
    """Construction of a job's machine.

    Attributes:
        chapters: In the order in which they began; the last step of the one that is simulated
            leads to the job's machine.
        machine: The machine at the end; None when nothing was built.
        complete: Whether every step is included.
    """

    chapters: list[Chapter]
    machine: Machine | None
    complete: bool


class Recorder:
    """Repeats actions and records them, up to a limit.

    Attributes:
        complete: Whether everything so far was recorded.
    """

    def __init__(self) -> None:
        self.complete = True
        self._told = 0
        self._work = 0

    def record(self, chapter: Chapter, turn: int | None, name: str, arguments: Any) -> bool:
        """Have the chapter's machine carry out an action.

        Returns:
            Whether it was accepted.
        """
        self._work += chapter.machine.part_count + sum(
            part.part_count for part in chapter.machine.available.values()
        )
        if not self.complete or self._work > MAX_WORK:
            self.complete = False
            return True
        outcome, changed = step(chapter.machine, name, arguments)
        attempted = outcome.attempted if isinstance(outcome, Refused) else ()
        self._told += sum(
            map(len, (changed.added, changed.moved, changed.rebound, changed.removed, attempted))
        )
        if self._told > MAX_PARTS_TOLD:
            self.complete = False
            return True
        refused = outcome if isinstance(outcome, Refused) else None
        chapter.steps.append(
            ReplayStep(
                turn=turn,
                action=name,
                arguments=arguments,
                accepted=refused is None,
                reason=None if refused is None else refused.reason.value,
                text=None if refused is None else refused.text,
                difference=changed,
                attempted=attempted,
            )
        )
        return refused is None


def refused_step(turn: int, action: Mapping[str, Any]) -> ReplayStep:
    """Return the step of an action that was refused before it reached the machine."""
    return ReplayStep(
        turn=turn,
        action=str(action["name"]),
        arguments=action["arguments"],
        accepted=False,
        reason=action["reason"] or "refused",
        text=action["feedback"],
    )
