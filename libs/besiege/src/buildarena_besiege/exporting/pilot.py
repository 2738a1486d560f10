"""Script part that runs a machine's program in the game."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any, Final

import numpy as np

from buildarena_besiege.errors import MachineNotPlayableError
from buildarena_besiege.exporting.lua_texts import lua_text
from buildarena_besiege.exporting.machine_file import BlockRecord
from buildarena_besiege.keys import UPDATES_PER_S, channel_keys
from buildarena_besiege.names import CARGO_ID
from buildarena_geometry import Machine
from buildarena_geometry.besiege_components import besiege_point
from buildarena_geometry.rotations import Vector, rotate
from buildarena_simulation import Scenario
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.controllers.pilot import ProgramPilot
from buildarena_simulation.controllers.program import (
    MAX_ANSWERS,
    MAX_INSTRUCTIONS,
    MAX_INSTRUCTIONS_IN_ALL,
    MAX_NAME,
    environment_text,
    layout_source,
)
from buildarena_simulation.controllers.senses import forwards, place_of
from buildarena_simulation.machine import bindings_of, part_ids, structure_of
from buildarena_simulation.sensor_config import SenseKind
from buildarena_simulation.structure.model import FloatArray, ShapeKind, Structure

NUMBERS_PER_LINE: Final = 24
"""Maximum numbers per line of senses and answers, for the width of the log window."""

NEAR_GROUND: Final = 0.05
"""Distance of a wheel's lowest point from flat ground that counts as contact, units."""

SEED: Final = 0
"""Seed of a program's random numbers and of the noise in the game, which perturbs nothing."""


def pilot_of(machine: Machine, scenario: Scenario) -> ProgramPilot:
    """Load a machine's program for a trial in the game.

    Raises:
        ControllerFailed: It is invalid, or the scenario allows none.
        MachineNotPlayableError: The scenario offers a sense that the game does not provide.
    """
    pilot = ProgramPilot(
        machine.controller,
        structure_of(machine),
        bindings_of(machine),
        part_ids(machine),
        scenario,
        seed=SEED,
    )
    if scenario.terrain and "wheels" in pilot.sensing.offers:
        raise MachineNotPlayableError(
            "the task offers the sense wheels[…].contact, which the game tells on flat ground alone"
        )
    if "contacts" in pilot.sensing.offers:
        raise MachineNotPlayableError(
            "the task offers the sense contacts, and the game does not tell what touches"
        )
    if "marks" in pilot.sensing.offers and any(mark.drift for mark in scenario.marks):
        raise MachineNotPlayableError("the task's marks move, which the game's script does not do")
    spring = next((name for (part, _), name in _channels(pilot) if part not in machine.blocks), "")
    if spring:
        raise MachineNotPlayableError(f"no key of the game's moves {spring}")
    return pilot


def _channels(pilot: ProgramPilot) -> list[tuple[tuple[str, str], str]]:
    """Return the block, the action and the name of each channel, in the order of their numbers."""
    return [
        ((name.removesuffix(f".{action}"), action), name)
        for (_, action), name in sorted(pilot.channels.names.items())
    ]


def pilot_lua(
    machine: Machine,
    scenario: Scenario,
    records: Sequence[BlockRecord],
    references: Mapping[str, str],
) -> str:
    """Return the part of a trial's script that runs the program and presses keys for its answers.

    Args:
        machine: Machine with a program.
        records: Blocks of the file.
        references: Name of each part in the script, as Lua.

    Raises:
        ControllerFailed: See `pilot_of`.
        MachineNotPlayableError: See `pilot_of`; or there are more actions than keys.
    """
    pilot = pilot_of(machine, scenario)
    senses = _SenseWriter(machine, scenario, pilot, records, references)
    calls = list(senses.calls())
    tables = {
        "seed": str(SEED),
        "rate": str(UPDATES_PER_S),
        "ticks_per_s": str(SAMPLE_RATE_HZ),
        "tick_updates": str(UPDATES_PER_S // SAMPLE_RATE_HZ),
        "numbers_per_line": str(NUMBERS_PER_LINE),
        "near_ground": repr(NEAR_GROUND),
        "tick_limit": str(MAX_INSTRUCTIONS),
        "trial_limit": str(MAX_INSTRUCTIONS_IN_ALL),
        "most_answers": str(MAX_ANSWERS),
        "longest_name": str(MAX_NAME),
        "delay": str(0 if scenario.senses is None else scenario.senses.delay_ticks),
        "noise": _table(repr(float(deviation)) for deviation in pilot.sensing.noise),
        "layout": lua_text(layout_source(pilot.sensing.layout)),
        "program": lua_text(machine.controller),
        "bodies": senses.bodies(),
        **_channel_tables(machine, pilot),
    }
    return "\n".join(
        [
            "local function environment(debug, os, collectgarbage, ...)",
            environment_text().decode(),
            "end",
            *(f"local {name} = {value}" for name, value in tables.items()),
            _pilot_text(),
            "sense = function()",
            *(f"  {call}" for call in calls),
            "end",
        ]
    )


def _channel_tables(machine: Machine, pilot: ProgramPilot) -> dict[str, str]:
    keys, channels = channel_keys(machine), pilot.channels
    order = sorted(channels.names)
    number = {key: index for index, key in enumerate(order, 1)}
    named = [
        f"[{lua_text(name)}] = {_table(str(number[key]) for key in parts)}"
        for name, parts in channels.named.items()
    ]
    single = [f"[{lua_text(name)}] = true" for name in channels.names.values()]
    opposites = [
        str(number[key[0], channels.opposites[key]] if key in channels.opposites else 0)
        for key in order
    ]
    rows = [
        f"machine.new_key_emulator({lua_text(keys[block][action][0])})"
        for (block, action), _ in _channels(pilot)
    ]
    return {
        "keys": _table(rows),
        "named": _table(named),
        "single": _table(single),
        "opposites": _table(opposites),
        "switches": _table(str(not channels.takes_share(*key)).lower() for key in order),
    }


class _SenseWriter:
    """Writes the calls that make a tick's senses, and the blocks that they look at."""

    def __init__(
        self,
        machine: Machine,
        scenario: Scenario,
        pilot: ProgramPilot,
        records: Sequence[BlockRecord],
        references: Mapping[str, str],
    ) -> None:
        self._machine, self._scenario, self._sensing = machine, scenario, pilot.sensing
        self._records = {record.part: record for record in records}
        self._references = references
        self._structure: Structure = structure_of(machine)
        self._order: list[str] = []
        self._number(next(iter(machine.blocks)))

    def calls(self) -> Iterable[str]:
        """Return the calls, in the order of the layout."""
        sensing, scenario = self._sensing, self._scenario
        calls: dict[SenseKind, Callable[[], Iterable[str]]] = {
            "pose": lambda: ["pose(1)"],
            "axes": lambda: ["axes(1)"],
            "blocks": lambda: map(self._block, sensing.blocks),
            "joints": lambda: map(self._joint, sensing.moving),
            "wheels": lambda: map(self._wheel, self._structure.wheels.tolist()),
            "cargo": lambda: [f"cargo_moves({self._number(CARGO_ID)})"],
            "marks": lambda: (f"place{_numbers(mark.center)}" for mark in scenario.marks),
            "gates": lambda: (f"place{_numbers((*g.center, 0.0))}" for g in scenario.gates),
            "gate": lambda: [f"next_gate({_centers(scenario)})"],
        }
        for kind in sensing.offers:
            yield from calls[kind]()

    def bodies(self) -> str:
        """Return the blocks: their keys, and their relation to the machine as it was built."""
        return _table(self._body(part) for part in self._order)

    def _number(self, part: str) -> int:
        if part not in self._order:
            self._order.append(part)
        return self._order.index(part) + 1

    def _body(self, part: str) -> str:
        record = self._records[part]
        w, x, y, z = record.rotation
        back = (w, -x, -y, -z)
        axes = [rotate(back, besiege_point(axis)) for axis in _AXES]
        if part == CARGO_ID:
            cargo = self._scenario.cargo
            above: Vector = (0.0, 0.0 if cargo is None else cargo.size[2] / 2, 0.0)
        else:
            index = self._structure.block_ids.index(part)
            center = besiege_point(_vector(self._structure.shown[index]))
            above = _vector(np.subtract(center, record.position))
        vectors = [rotate(back, above), *axes]
        shown = ", ".join(_table(repr(number) for number in vector) for vector in vectors)
        return f"{{{self._references[part]}, {shown}}}"

    def _attachment(self, index: int) -> tuple[int, int, str, str, int]:
        """Return a block, its base, the axis, its forward action's sign, and its base's index."""
        part = self._structure.parts[index].id
        mount = self._machine.blocks[part].mount
        at = self._structure.block_ids.index(mount[0]) if mount is not None else 0
        axis = _table(map(repr, _vector(self._structure.joints.axes[index])))
        sign = repr(forwards(self._structure, index))
        base = self._structure.parts[at].id
        return self._number(part), self._number(base), axis, sign, at

    def _block(self, index: int) -> str:
        return f"pose({self._number(self._structure.parts[index].id)})"

    def _joint(self, index: int) -> str:
        own, base, axis, sign, at = self._attachment(index)
        if place_of(self._structure, index) == "angle":
            return f"turn({own}, {base}, {axis}, {sign})"
        point, shown = self._structure.joints.points[index], self._structure.shown
        arms = (_table(map(repr, _vector(point - shown[block]))) for block in (index, at))
        return f"slide({own}, {base}, {axis}, {sign}, {', '.join(arms)})"

    def _wheel(self, index: int) -> str:
        own, base, axis, sign, _ = self._attachment(index)
        shape = max(self._structure.parts[index].shapes, key=lambda shape: shape.volume)
        radius, _, half = _vector(shape.half_extents)
        half = half if shape.kind is ShapeKind.CYLINDER else 0.0
        return f"wheel({own}, {base}, {axis}, {sign}, {radius!r}, {half!r})"


_AXES: Final[tuple[Vector, ...]] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@cache
def _pilot_text() -> str:
    return files(__package__).joinpath("pilot.lua").read_text(encoding="utf-8")


def _vector(numbers: FloatArray | Any) -> Vector:
    x, y, z = (float(number) + 0.0 for number in numbers)
    return (x, y, z)


def _centers(scenario: Scenario) -> str:
    return _table(_table(map(repr, gate.center)) for gate in scenario.gates)


def _numbers(numbers: Iterable[float]) -> str:
    return f"({', '.join(repr(float(number)) for number in numbers)})"


def _table(items: Iterable[str]) -> str:
    return "{" + ", ".join(items) + "}"
