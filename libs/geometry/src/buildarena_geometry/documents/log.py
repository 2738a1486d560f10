"""Record of the actions on a machine and their outcomes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from buildarena_geometry.outcomes import RefusalClass
from buildarena_geometry.state import MachineState
from buildarena_geometry.struct_reader import Form


class ActionRecord(Form, frozen=True, kw_only=True):
    """An action with its arguments as received.

    Attributes:
        arguments: JSON values. A value that JSON cannot express is replaced by an object
            {"unreadable": its text}, which every action refuses as it refused the original.
        reason: cause of its refusal; None if it was accepted.
    """

    name: str
    arguments: Any
    reason: RefusalClass | None = None

    @property
    def ok(self) -> bool:
        """True if it was accepted."""
        return self.reason is None


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedState:
    """A machine as a value: what it is, and how it came to be.

    Attributes:
        state: everything it is.
        records: accepted and refused actions in order.
        available: the machines an assembly may be made of, by name.
    """

    state: MachineState
    records: tuple[ActionRecord, ...]
    available: Mapping[str, LoggedState]
