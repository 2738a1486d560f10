"""What all workflows share: the form of a workflow, and the way from a machine to its score."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from buildarena_geometry import Machine
from buildarena_store import RolloutRecord
from buildarena_worker.control import drive
from buildarena_worker.errors import ConstructionFailedError
from buildarena_worker.session import Session


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionEnd:
    """A session that came to its end.

    Attributes:
        machine: What was built.
        best: The rollout that counts.
    """

    machine: Machine
    best: RolloutRecord


class Workflow(Protocol):
    """A way to build. It may use the session only, so that a replay does the same again."""

    name: str

    def build(self, session: Session) -> Machine:
        """Builds the machine of the session's task.

        Raises:
            ConstructionFailedError: The model gave up or broke the rules.
        """


def run_session(session: Session, workflow: Workflow) -> SessionEnd:
    """Builds, checks and simulates.

    Raises:
        ConstructionFailedError: No machine came out that may be simulated.
        SuspendedError: A simulation must be done first.
    """
    machine = workflow.build(session)
    session.check_machine(machine)
    if session.task.control == "agent":
        return SessionEnd(machine=machine, best=drive(session, machine))
    return SessionEnd(machine=machine, best=session.io.simulate(machine, None, final=True))


def require_started(machine: Machine) -> None:
    """Checks that there is a machine to go on with.

    Raises:
        ConstructionFailedError: Nothing was started.
    """
    if not machine.started:
        raise ConstructionFailedError("empty_machine", "no machine was started")
