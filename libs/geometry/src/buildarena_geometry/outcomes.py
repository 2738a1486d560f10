"""Outcomes of an action: accepted or refused, with the text that a model reads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import ClassVar, Literal

from buildarena_geometry.rotations import Quaternion, Vector


class RefusalClass(StrEnum):
    """Reason for a refusal, by which results are counted.

    The first ten are the paper's failure reasons (appendix "Definitions of Failure Reasons").
    """

    MODULE_RESTRICTION = "module_restriction"
    BLOCK_PRESENCE = "block_presence"
    CONNECTOR_MISUSE = "connector_misuse"
    FACE_OCCUPIED = "face_occupied"
    EXCESS_CONNECTION = "excess_connection"
    FACE_PRESENCE = "face_presence"
    MULTIPLE_INITIALIZATION = "multiple_initialization"
    INITIALIZATION_ABSENT = "initialization_absent"
    SPIN_CAPABILITY = "spin_capability"
    OVERLAP = "overlap"
    TOO_CLOSE = "too_close"
    BAD_KEY = "bad_key"
    UNKNOWN_ACTION = "unknown_action"
    BAD_INDEX = "bad_index"
    OUT_OF_RANGE = "out_of_range"
    MALFORMED_ARGUMENTS = "malformed_arguments"
    UNKNOWN_SUB_STRUCTURE = "unknown_sub_structure"


class Cause(StrEnum):
    """Exact cause of a refusal; several causes can belong to one refusal class."""

    NOT_STARTED = "not_started"
    ALREADY_STARTED = "already_started"
    UNKNOWN_MODULE = "unknown_module"
    UNKNOWN_CONNECTOR = "unknown_connector"
    CONNECTOR_MISUSE = "connector_misuse"
    BASIC_AS_CONNECTOR = "basic_as_connector"
    NO_SUCH_BLOCK = "no_such_block"
    START_BLOCK = "start_block"
    NO_SUCH_FACE = "no_such_face"
    NO_FACES = "no_faces"
    FACE_OCCUPIED = "face_occupied"
    EXCESS_CONNECTION = "excess_connection"
    TOO_CLOSE = "too_close"
    NOT_SPINNING = "not_spinning"
    OVERLAP = "overlap"
    BAD_KEY = "bad_key"
    NO_LOCOMOTION = "no_locomotion"
    BAD_ACTION = "bad_action"
    UNKNOWN_ACTION = "unknown_action"
    BAD_INDEX = "bad_index"
    OUT_OF_RANGE = "out_of_range"
    MALFORMED_ARGUMENTS = "malformed_arguments"
    NO_SUCH_MACHINE = "no_such_machine"


_CLASS_OF_CAUSE = {
    Cause.NOT_STARTED: RefusalClass.INITIALIZATION_ABSENT,
    Cause.ALREADY_STARTED: RefusalClass.MULTIPLE_INITIALIZATION,
    Cause.UNKNOWN_MODULE: RefusalClass.MODULE_RESTRICTION,
    Cause.UNKNOWN_CONNECTOR: RefusalClass.MODULE_RESTRICTION,
    Cause.BASIC_AS_CONNECTOR: RefusalClass.CONNECTOR_MISUSE,
    Cause.NO_SUCH_BLOCK: RefusalClass.BLOCK_PRESENCE,
    Cause.START_BLOCK: RefusalClass.BLOCK_PRESENCE,
    Cause.NO_SUCH_FACE: RefusalClass.FACE_PRESENCE,
    Cause.NO_FACES: RefusalClass.FACE_PRESENCE,
    Cause.NOT_SPINNING: RefusalClass.SPIN_CAPABILITY,
    Cause.NO_LOCOMOTION: RefusalClass.UNKNOWN_ACTION,
    Cause.BAD_ACTION: RefusalClass.UNKNOWN_ACTION,
    Cause.NO_SUCH_MACHINE: RefusalClass.UNKNOWN_SUB_STRUCTURE,
}
"""The class of each cause whose class has another name."""


class Accepted:
    """An action that was carried out.

    Attributes:
        changed: ids of the blocks and connectors that are new, different or gone.
    """

    ok: Literal[True] = True

    def __init__(self, *, changed: tuple[str, ...], render: Callable[[], str]) -> None:
        """Defer rendering of the feedback, which costs more than the action."""
        self.changed = changed
        self._render = render

    @cached_property
    def text(self) -> str:
        """Text that a model reads, about the machine as it was when the action ended."""
        return self._render()

    def __repr__(self) -> str:
        return f"Accepted({self.text!r})"


@dataclass(frozen=True, slots=True, kw_only=True)
class AttemptedBlock:
    """A block where a refused action would have put it.

    Attributes:
        id: the id it has, or would have got.
        module: name of its module.
        position: (3,) its root point, world frame, units.
        quaternion: (4,) how it would be turned, (w, x, y, z).
    """

    id: str
    module: str
    position: Vector
    quaternion: Quaternion


@dataclass(frozen=True, slots=True, kw_only=True)
class Refused:
    """An action that was refused; the machine is unchanged.

    Attributes:
        text: text that a model reads: the fault and the valid choices.
        overlaps: the pairs of block ids that would overlap; a new block has its id to be.
        attempted: blocks at the poses that were refused; empty if those are unknown.
    """

    ok: ClassVar[Literal[False]] = False

    cause: Cause
    text: str
    overlaps: tuple[tuple[str, str], ...] = ()
    attempted: tuple[AttemptedBlock, ...] = ()

    @property
    def reason(self) -> RefusalClass:
        """The class results are counted by."""
        return _CLASS_OF_CAUSE.get(self.cause) or RefusalClass(self.cause.value)


Outcome = Accepted | Refused
