"""Outcomes of an action: accepted or refused, with the text that a model reads."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import ClassVar, Literal, Self

from buildarena_geometry.blocks import Block


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
    """Exact cause of a refusal; several causes can belong to one refusal class.

    Attributes:
        reason: The class, by default the one with the cause's name.
    """

    reason: RefusalClass

    def __new__(cls, name: str, reason: RefusalClass | None = None) -> Self:
        """Create the cause of a name."""
        cause = str.__new__(cls, name)
        cause._value_, cause.reason = name, reason or RefusalClass(name)
        return cause

    NOT_STARTED = "not_started", RefusalClass.INITIALIZATION_ABSENT
    ALREADY_STARTED = "already_started", RefusalClass.MULTIPLE_INITIALIZATION
    UNKNOWN_MODULE = "unknown_module", RefusalClass.MODULE_RESTRICTION
    UNKNOWN_CONNECTOR = "unknown_connector", RefusalClass.MODULE_RESTRICTION
    CONNECTOR_MISUSE = "connector_misuse"
    BASIC_AS_CONNECTOR = "basic_as_connector", RefusalClass.CONNECTOR_MISUSE
    NO_SUCH_BLOCK = "no_such_block", RefusalClass.BLOCK_PRESENCE
    START_BLOCK = "start_block", RefusalClass.BLOCK_PRESENCE
    NO_SUCH_FACE = "no_such_face", RefusalClass.FACE_PRESENCE
    NO_FACES = "no_faces", RefusalClass.FACE_PRESENCE
    FACE_OCCUPIED = "face_occupied"
    EXCESS_CONNECTION = "excess_connection"
    TOO_CLOSE = "too_close"
    NOT_SPINNING = "not_spinning", RefusalClass.SPIN_CAPABILITY
    OVERLAP = "overlap"
    BAD_KEY = "bad_key"
    NO_LOCOMOTION = "no_locomotion", RefusalClass.UNKNOWN_ACTION
    BAD_ACTION = "bad_action", RefusalClass.UNKNOWN_ACTION
    UNKNOWN_ACTION = "unknown_action"
    BAD_INDEX = "bad_index"
    OUT_OF_RANGE = "out_of_range"
    MALFORMED_ARGUMENTS = "malformed_arguments"
    NO_SUCH_MACHINE = "no_such_machine", RefusalClass.UNKNOWN_SUB_STRUCTURE


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
class Refused:
    """An action that was refused; the machine is unchanged.

    Attributes:
        text: text that a model reads: the fault and the valid choices.
        overlaps: the pairs of block ids that would overlap; a new block has its id to be.
        attempted: the blocks where the action would have put them, with the ids they have or would
            have got; empty if the poses are unknown.
    """

    ok: ClassVar[Literal[False]] = False

    cause: Cause
    text: str
    overlaps: tuple[tuple[str, str], ...] = ()
    attempted: tuple[Block, ...] = ()

    @property
    def reason(self) -> RefusalClass:
        """The class results are counted by."""
        return self.cause.reason


Outcome = Accepted | Refused
