"""From the task to the score: one round, or several when a closed loop is wanted.

In a closed loop a failed round is followed by another, which is told what the simulator said,
and, if an analyst is wanted, what that analyst advises.
"""

from __future__ import annotations

from dataclasses import dataclass

from buildarena_geometry import Machine
from buildarena_pipeline.runtime.scoring import best_rollout
from buildarena_store import RolloutRecord
from buildarena_worker.errors import ConstructionFailedError
from buildarena_worker.session.session import Session
from buildarena_worker.workflow.analyst import analyse
from buildarena_worker.workflow.base import SessionEnd, Workflow
from buildarena_worker.workflow.control import drive
from buildarena_worker.workflow.examples import example_for


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """What a session does besides one round of its workflow.

    Attributes:
        rounds: Rounds at the most; 1 is the benchmark's single shot.
        analyst: Whether an analyst advises between rounds.
        one_shot: Whether an example construction is shown.
    """

    rounds: int = 1
    analyst: bool = False
    one_shot: bool = False


def run_session(session: Session, workflow: Workflow, loop: Loop) -> SessionEnd:
    """Builds, checks and simulates, in as many rounds as wanted and needed.

    Raises:
        ConstructionFailedError: No round gave a machine that may be simulated.
        SuspendedError: A simulation must be done first.
    """
    if loop.one_shot:
        session.additions.append(example_for(session.task, session.pack))
    records: list[RolloutRecord] = []
    failure: ConstructionFailedError | None = None
    for number in range(1, loop.rounds + 1):
        final = number == loop.rounds
        try:
            machine, record = _one_round(session, workflow, final=final)
        except ConstructionFailedError as error:
            failure = error
            session.additions.append(
                session.pack.say("round_failed", round=str(number), reason=str(error))
            )
            continue
        records.append(record)
        if record.success or final:
            break
        _tell_result(session, machine, record, number, loop)
    if not records:
        assert failure is not None, "a loop has at least one round"  # noqa: S101 - ours
        raise failure
    return SessionEnd(best=best_rollout(records))


def _one_round(
    session: Session, workflow: Workflow, *, final: bool
) -> tuple[Machine, RolloutRecord]:
    machine = workflow.build(session)
    session.check_machine(machine)
    if session.task.control == "agent":
        return machine, drive(session, machine, final=final)
    return machine, session.io.simulate(machine, None, final=final)


def _tell_result(
    session: Session, machine: Machine, record: RolloutRecord, number: int, loop: Loop
) -> None:
    result = describe(session, record)
    session.additions.append(session.pack.say("round_result", round=str(number), result=result))
    if loop.analyst:
        advice = analyse(session, machine, record, number=number, result=result)
        session.additions.append(session.pack.say("advice", round=str(number), advice=advice))


def describe(session: Session, record: RolloutRecord) -> str:
    """A rollout's result in words, generated from its score."""
    indicator = session.task.indicator
    parts = [
        "It succeeded." if record.success else "It did not succeed.",
        f"{indicator.name.capitalize()}: {record.indicator or 0.0:.2f} {indicator.unit}.".strip(),
    ]
    metrics = record.metrics or {}
    known = [f"{name} {_spelled(value)}" for name, value in metrics.items() if value is not None]
    if known:
        parts.append("Measured: " + ", ".join(known) + ".")
    if record.flags:
        parts.append("Flags: " + ", ".join(record.flags) + ".")
    return " ".join(parts)


def _spelled(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
