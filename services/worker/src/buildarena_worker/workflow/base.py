"""What all workflows share: their form, and what each asks of a machine."""

from __future__ import annotations

from typing import Protocol

from buildarena_geometry import Machine
from buildarena_worker.session.results import ConstructionFailedError
from buildarena_worker.session.session import Session


class Workflow(Protocol):
    """A way to build. It may use the session only, so that a replay does the same again."""

    name: str

    def build(self, session: Session) -> Machine:
        """Builds the machine of the session's task.

        Raises:
            ConstructionFailedError: The model gave up or broke the rules.
        """


def require_started(machine: Machine) -> None:
    """Checks that there is a machine to go on with.

    Raises:
        ConstructionFailedError: Nothing was started.
    """
    if not machine.started:
        raise ConstructionFailedError("empty_machine", "no machine was started")
