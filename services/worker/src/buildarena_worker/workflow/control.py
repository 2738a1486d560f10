"""The control phase: the controller programs the keys, sees the result, and revises."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from buildarena_geometry import KeyPress, Machine
from buildarena_pipeline.runtime.scoring import best_rollout
from buildarena_store import RolloutRecord
from buildarena_worker.session.dialogue import Dialogue, Role
from buildarena_worker.session.results import ConstructionFailedError
from buildarena_worker.session.session import Session

ATTEMPTS = 3
"""Attempts of a transport session; the best counts. Source: the paper's task details."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Program:
    machine: Machine
    presses: Sequence[KeyPress]


class _ProgramError(ValueError):
    """The controller's answer can't be used; the message tells it why."""


def drive(session: Session, machine: Machine, *, final: bool) -> RolloutRecord:
    """Lets the controller drive the machine in up to three attempts.

    Args:
        session: The session.
        machine: What is to be driven.
        final: Whether the job ends with the last attempt.

    Returns:
        The best rollout.

    Raises:
        ConstructionFailedError: No attempt had a usable program.
        SessionEnded: A simulation must be done first.
    """
    pack, task = session.pack, session.task
    opening = pack.say(
        "control",
        task=task.name,
        statement=session.statement,
        summary=machine.act("get_machine_summary", {}).text,
        powered=machine.act("review_powered_blocks", {}).text,
    )
    dialogue = Dialogue(session, phase="control", opening=opening)
    controller = Role(name="controller", system=pack.roles["controller"])
    records: list[RolloutRecord] = []
    extra, problem = "", ""
    for attempt in range(1, ATTEMPTS + 1):
        text = dialogue.turn(controller, extra=extra).text
        try:
            program = _read_program(machine, text)
        except _ProgramError as error:
            problem = result = str(error)
            trajectory = "(not simulated)"
        else:
            session.machine = program.machine
            record = session.host.simulate(
                program.machine, program.presses, final=final and attempt == ATTEMPTS
            )
            records.append(record)
            trajectory = _rendered(record.trace or ())
            result = (
                f"{'success' if record.success else 'no success'}, "
                f"{task.indicator.name} {record.indicator:.2f} {task.indicator.unit}"
            )
        extra = pack.say(
            "control_again",
            trial=str(attempt),
            trials=str(ATTEMPTS),
            trajectory=trajectory,
            result=result,
        )
    if not records:
        raise ConstructionFailedError("control_invalid", problem)
    return best_rollout(records)


def _read_program(machine: Machine, text: str) -> _Program:
    data = _json_object(text)
    driven = Machine.from_document(machine.to_document())
    bindings = data.get("control_config")
    if not isinstance(bindings, list) or not bindings:
        raise _ProgramError("control_config must be a list with at least one entry")
    for index, entry in enumerate(bindings):
        keys = entry.get("keys") if isinstance(entry, dict) else None
        if not isinstance(keys, list) or not keys:
            raise _ProgramError(f"control_config[{index}] needs block, action and keys")
        for key in keys:
            arguments = {
                "block_id": entry.get("block"),
                "action": entry.get("action"),
                "new_key": key,
            }
            outcome = driven.act("add_control_key", arguments)
            if not outcome.ok:
                raise _ProgramError(f"control_config[{index}]: {outcome.text}")
    presses = data.get("control_sequence")
    if not isinstance(presses, list) or not presses:
        raise _ProgramError("control_sequence must be a list with at least one entry")
    for index, press in enumerate(presses):
        outcome = driven.act("add_control_sequence", press)
        if not outcome.ok:
            raise _ProgramError(f"control_sequence[{index}]: {outcome.text}")
    return _Program(machine=driven, presses=driven.control_sequence)


def _rendered(trace: Sequence[Sequence[float]]) -> str:
    return "\n".join(", ".join(f"{value:.2f}" for value in row) for row in trace) or "(none)"


def _json_object(text: str) -> dict[str, Any]:
    start, end = text.find("{"), text.rfind("}")
    if start < 0 or end < start:
        raise _ProgramError("the answer holds no JSON object")
    try:
        data = json.loads(text[start : end + 1])
    except (ValueError, RecursionError) as error:
        raise _ProgramError(f"the answer's JSON can't be read: {error}") from error
    if not isinstance(data, dict):
        raise _ProgramError("the answer must be one JSON object")
    return data
