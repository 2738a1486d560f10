"""The process of one drive: it simulates at the speed of the clock, with the keys that are held."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Final

from pydantic import BaseModel

from buildarena_api.driving.messages import (
    FRAME,
    HEAD,
    NEWS,
    Broke,
    Ended,
    Keys,
    PressView,
    Ready,
    Refused,
    Why,
)
from buildarena_api.scenes import scene_view
from buildarena_environment.warm_process import limit_memory
from buildarena_geometry import Machine
from buildarena_simulation import (
    BuildarenaSimulationError,
    KeyDrive,
    MachineNotSimulable,
    Scenario,
    SimulationError,
)
from buildarena_simulation.controllers.senses import TICK_S

WAIT_S: Final = 120.0
"""How long a drive waits for its first key."""
LONGEST_S: Final = 300.0
"""Of trials that last longer no more is driven; also the wall time of those that run slowly."""
MAX_PRESSES: Final = 1500
MAX_HEARD: Final = 50
"""Messages that are read in a tick."""
BEHIND_S: Final = 0.2
"""A drive that is so late goes on from now: it becomes slow, and does not jump."""
SPARE_BYTES: Final = 1 << 30


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """What is driven where.

    Attributes:
        document: The machine, as JSON.
        scenario: What it is put through, as JSON.
        engine: Name of the engine.
    """

    document: bytes
    scenario: str
    engine: str


@dataclass(slots=True)
class _Hands:
    """The keys as they are held now."""

    held: frozenset[str] = frozenset()
    number: int = 0
    why: Why | None = None
    began: bool = field(default=False)

    def hear(self, message: bytes) -> None:
        keys = Keys.model_validate_json(message)
        self.held, self.number = frozenset(keys.held), keys.number
        self.began = self.began or bool(keys.held)
        if keys.end:
            self.why = "stopped"


def serve(pipe: Connection, course: Course) -> None:
    """Drives until the trial or its driver ends it; a pipe that is closed ends it at once.

    Args:
        pipe: Brings `Keys` as JSON; takes `Ready` or `Refused`, frames, `Broke` and `Ended`.
        course: What is driven where.
    """
    limit_memory(SPARE_BYTES)
    try:
        machine = Machine.from_document(json.loads(course.document))
        scenario = Scenario.model_validate_json(course.scenario)
        drive = KeyDrive(machine, scenario, course.engine)
    except MachineNotSimulable as error:
        _tell(pipe, Refused(detail=str(error)))
        return
    except BuildarenaSimulationError as error:
        _tell(pipe, Refused(detail=f"the simulator failed: {error}"))
        return
    with closing(drive):
        ready = Ready(
            scene=scene_view(scenario, machine),
            keys=_bound(machine) if scenario.control.mode == "agent" else {},
            duration_s=min(scenario.duration_s, LONGEST_S),
        )
        try:
            _tell(pipe, ready)
            _drive(pipe, drive)
        except (EOFError, OSError):
            return  # nobody is there any more


def _drive(pipe: Connection, drive: KeyDrive) -> None:
    hands, broken = _Hands(), 0
    _frame(pipe, drive, hands)
    why, detail = _wait(pipe, hands), ""
    ticks = _ticks(pipe, hands) if why is None else iter(())
    try:
        for _ in ticks:
            drive.step(hands.held)
            _frame(pipe, drive, hands)
            if len(drive.breaks) > broken:
                joints = [f"{one.kind} {one.joint}" for one in drive.breaks[broken:]]
                _tell(pipe, Broke(joints=joints, time_s=drive.breaks[-1].time_s))
                broken = len(drive.breaks)
            why = _why(drive, hands)
            if why is not None:
                break
    except SimulationError as error:
        why, detail = "failed", str(error)
    ended = Ended(
        why=why or "too_long",
        detail=detail,
        time_s=drive.tick * TICK_S,
        presses=[
            PressView(time_s=one.time_s, key=one.key, hold_for_s=one.hold_for_s)
            for one in drive.presses()
        ],
    )
    _tell(pipe, ended)


def _why(drive: KeyDrive, hands: _Hands) -> Why | None:
    """Why it ends now; None while it goes on."""
    if hands.why is not None:
        return hands.why
    if drive.has_blown_up:
        return "blown_up"
    if len(drive.presses()) > MAX_PRESSES:
        return "too_many_presses"
    return "time" if drive.is_over else None


def _wait(pipe: Connection, hands: _Hands) -> Why | None:
    """Until the first key is held; why there is no drive if none is."""
    until = time.monotonic() + WAIT_S
    while not hands.began and hands.why is None:
        if not pipe.poll(max(0.0, until - time.monotonic())):
            return "too_long"
        hands.hear(pipe.recv_bytes())
    return hands.why


def _ticks(pipe: Connection, hands: _Hands) -> Iterator[int]:
    """Comes back once a tick, with the keys that are held by then."""
    due = time.monotonic()
    last, tick = due + LONGEST_S, 0
    while due < last and tick * TICK_S < LONGEST_S:
        for _ in range(MAX_HEARD):
            if not pipe.poll(max(0.0, due - time.monotonic())):
                break
            hands.hear(pipe.recv_bytes())
        yield tick
        tick += 1
        due = max(due + TICK_S, time.monotonic() - BEHIND_S)


def _frame(pipe: Connection, drive: KeyDrive, hands: _Hands) -> None:
    head = HEAD.pack(drive.tick * TICK_S, hands.number)
    pipe.send_bytes(FRAME + head + drive.poses.astype("<f4").tobytes())


def _tell(pipe: Connection, message: BaseModel) -> None:
    pipe.send_bytes(NEWS + message.model_dump_json().encode())


def _bound(machine: Machine) -> dict[str, list[str]]:
    """By key, the actions that it is bound to and of how many parts."""
    actions: dict[str, dict[str, list[str]]] = {}
    bindings = {part.id: part.bindings for part in machine.blocks.values()}
    bindings |= {part.id: part.bindings for part in machine.connectors.values()}
    for part, bound in bindings.items():
        for action, keys in bound.items():
            for key in keys:
                actions.setdefault(key, {}).setdefault(action, []).append(part)
    return {
        key: [f"{action} of {', '.join(parts)}" for action, parts in does.items()]
        for key, does in sorted(actions.items())
    }
