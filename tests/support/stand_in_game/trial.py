"""What would happen to a machine: one rollout of ours, looked up by game time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from pydantic import Field

from buildarena_geometry import KeyPress
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.engines.base import CargoBox
from buildarena_simulation.machine import structure_of
from buildarena_simulation.placement import Start
from buildarena_simulation.rollout import simulate_structure
from buildarena_simulation.scenario import Cargo, Control, Scenario, TerrainBox
from buildarena_simulation.trajectory import Trajectory
from stand_in_game.frames import Array, from_quaternion, swapped, world_axes
from stand_in_game.machine_file import BALLAST, FileBlock, FileMachine
from stand_in_game.rebuilding import ALWAYS, Rebuilt, rebuild

UPDATES_PER_S: Final = 100
_CLEARANCE: Final = 0.005
"""Height above the floor that "set ground" leaves, units: ours, as our own placement's."""


class ScriptedCargo(Cargo):
    """A cargo whose mass a script sets.

    Attributes:
        masses: (n,) mass from each update on, mass units; the first from the start on.
    """

    masses: tuple[float, ...] = Field(min_length=1)

    def mass_at(self, time_s: float) -> float:
        """Mass of the cargo at a time, mass units."""
        update = int(time_s * UPDATES_PER_S + 1e-6)
        return self.masses[min(update, len(self.masses) - 1)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Inputs:
    """What a script or a player does to a machine.

    Attributes:
        presses: the holds of keys, names in lower case.
        masses: the cargo's mass from each update on; empty for what the file says.
    """

    presses: tuple[KeyPress, ...] = ()
    masses: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One block of the file at one moment, in the game's components.

    Attributes:
        type_id: its type.
        position: (3,) its root, units.
        right: (3,) its own axis, as up and forward.
        up: see right.
        forward: see right.
        burning: whether a flame heats it.
    """

    type_id: int
    position: tuple[float, float, float]
    right: tuple[float, float, float]
    up: tuple[float, float, float]
    forward: tuple[float, float, float]
    burning: bool = False


class Placed:
    """A machine of a file at its place in the world, as built.

    Args:
        file: the machine.
        on_ground: whether "set ground" has put it on the floor.
    """

    def __init__(self, file: FileMachine, *, on_ground: bool = False) -> None:
        self.file, self.rebuilt = file, rebuild(file)
        self.structure = structure_of(self.rebuilt.machine)
        axes = world_axes(file.rotation)
        # Columns are right, up, forward; a machine frame has right, forward, up as x, y, z.
        self.rotation: Array = axes[:, [0, 2, 1]]
        self.position: Array = swapped(file.position)
        if on_ground:
            self.position = self.position + np.array([0.0, 0.0, _CLEARANCE - self._lowest()])

    def root(self, block: FileBlock) -> Array:
        """(3,) where a block's root is, world frame, units."""
        return np.asarray(self.rotation @ swapped(block.position) + self.position)

    def axes(self, block: FileBlock) -> Array:
        """(3, 3) a block's right, up and forward as columns, world frame."""
        return np.asarray(self.rotation @ world_axes(block.rotation))

    def cargo_box(self) -> CargoBox | None:
        """The cargo where the file puts it; a box that is not upright is taken as if it were."""
        block = self._cargo()
        if block is None:
            return None
        axes, scale = self.axes(block), np.array(block.scale)
        center = self.root(block) + axes[:, 2] * scale[2] / 2
        mass = block.data.get("bmt-mass", 5.0)
        return CargoBox(
            size=np.abs(axes) @ scale,
            position=center,
            mass=float(mass) if isinstance(mass, int | float) else 5.0,
        )

    def start(self) -> Start:
        """The start of the simulation."""
        return Start(position=self.position, rotation=self.rotation, cargo=self.cargo_box())

    def _cargo(self) -> FileBlock | None:
        place = self.rebuilt.cargo
        return None if place is None else self.file.blocks[place]

    def _lowest(self) -> float:
        rotation, low = self.rotation, math.inf
        for part in self.structure.parts:
            for shape in part.shapes:
                turned = rotation @ shape.rotation
                reach = float(np.abs(turned[2]) @ shape.half_extents)
                if shape.kind.name == "CYLINDER":
                    flat = math.hypot(turned[2, 0], turned[2, 1]) * shape.half_extents[0]
                    reach = flat + abs(turned[2, 2]) * shape.half_extents[2]
                low = min(low, float((rotation @ shape.center + self.position)[2]) - reach)
        box = self.cargo_box()
        if box is not None:
            low = min(low, float(box.position[2] - box.size[2] / 2))
        return low


class Flight:
    """The rollout of a placed machine; positions between its samples are interpolated.

    Args:
        placed: the machine.
        terrain: the level's boxes.
        inputs: keys and masses over the whole time.
        duration_s: how much is known; later the machine is as it was then.
    """

    def __init__(
        self,
        placed: Placed,
        terrain: Sequence[TerrainBox],
        inputs: Inputs,
        *,
        duration_s: float,
    ) -> None:
        self.placed = placed
        self.trajectory = _simulated(placed, terrain, inputs, duration_s)
        self._columns = {block: k for k, block in enumerate(self.trajectory.block_ids)}
        cannons = self.trajectory.cannon_ids
        self._cannons = {int(block): k for k, block in enumerate(cannons)}
        self._carried = [self._carry(k, block) for k, block in enumerate(placed.file.blocks)]
        self._time: float | None = None
        self._seen: dict[int, Part] = {}

    def part(self, place: int, time_s: float) -> Part:
        """One block of the file at a time."""
        if time_s != self._time:
            self._time, self._seen = time_s, {}
        if place not in self._seen:
            self._seen[place] = self._part(place, time_s)
        return self._seen[place]

    def broken(self, time_s: float) -> set[int]:
        """Places of the blocks whose joint to their base has given way."""
        parts = [b.joint.split("-")[-1] for b in self.trajectory.breaks if b.time_s <= time_s]
        return {int(part) for part in parts if part.isdecimal()}

    def _carry(self, place: int, block: FileBlock) -> tuple[str, Array, Array]:
        """What carries a block, and its root and axes relative to that."""
        placed, machine = self.placed, self.placed.rebuilt.machine
        if block.type_id == BALLAST and place == placed.rebuilt.cargo:
            box = placed.cargo_box()
            assert box is not None
            return "cargo", placed.root(block) - box.position, placed.axes(block)
        link = machine.connectors.get(str(place))
        carrier = link.start[0] if link is not None else str(place)
        if carrier not in machine.blocks:
            return "", placed.root(block), placed.axes(block)
        by = machine.blocks[carrier]
        turn = placed.rotation @ np.array(by.world_from_block.rotation)
        center = placed.rotation @ np.array(by.center) + placed.position
        return carrier, turn.T @ (placed.root(block) - center), turn.T @ placed.axes(block)

    def _part(self, place: int, time_s: float) -> Part:
        carrier, root, axes = self._carried[place]
        if carrier:
            position, turn = self._pose(carrier, time_s)
            root, axes = position + turn @ root, turn @ axes
        right, up, forward = (_plain(swapped(column)) for column in axes.T)
        heated = False
        if place in self._cannons:
            rows = self.trajectory.heated
            row = min(int(time_s * SAMPLE_RATE_HZ + 1e-6), len(rows) - 1)
            heated = bool(rows[row, self._cannons[place]])
        return Part(
            type_id=self.placed.file.blocks[place].type_id,
            position=_plain(swapped(root)),
            right=right,
            up=up,
            forward=forward,
            burning=heated,
        )

    def _pose(self, carrier: str, time_s: float) -> tuple[Array, Array]:
        found = self.trajectory
        if carrier == "cargo":
            positions, turns = found.cargo_position, found.cargo_quaternion
            assert positions is not None
            assert turns is not None
        else:
            column = self._columns[carrier]
            positions, turns = found.positions[:, column], found.quaternions[:, column]
        row = min(time_s * SAMPLE_RATE_HZ, len(positions) - 1.0)
        first = min(int(row + 1e-6), len(positions) - 1)
        share = max(0.0, row - first)
        if share < 1e-6 or first + 1 >= len(positions):
            return positions[first].astype(float), from_quaternion(turns[first])
        before, after = turns[first].astype(float), turns[first + 1].astype(float)
        after = after if before @ after >= 0 else -after
        mixed = (1 - share) * before + share * after
        point = (1 - share) * positions[first].astype(float) + share * positions[first + 1]
        return point, from_quaternion(mixed / np.linalg.norm(mixed))


def _simulated(
    placed: Placed, terrain: Sequence[TerrainBox], inputs: Inputs, duration_s: float
) -> Trajectory:
    start, rebuilt = placed.start(), placed.rebuilt
    cargo = None
    if start.cargo is not None:
        # The script sets the mass before the first step, so the file's own is never weighed.
        masses = inputs.masses[1:2] + inputs.masses[1:] or (start.cargo.mass,)
        start = replace(start, cargo=replace(start.cargo, mass=masses[0]))
        cargo = ScriptedCargo(
            size=_plain(start.cargo.size),
            final_mass=masses[-1],
            ramp_s=1.0,
            masses=tuple(max(mass, 0.01) for mass in masses),
        )
    scenario = Scenario(
        duration_s=duration_s,
        terrain=tuple(terrain),
        cargo=cargo,
        control=Control(mode="agent"),
    )
    always = KeyPress(time_s=0.0, key=ALWAYS, hold_for_s=duration_s)
    return simulate_structure(
        placed.structure,
        scenario,
        "mujoco",
        bindings=_lower(rebuilt),
        controls=(*inputs.presses, always),
        start=start,
    )


def _lower(rebuilt: Rebuilt) -> list[dict[str, tuple[str, ...]]]:
    return [
        {action: tuple(key.lower() for key in keys) for action, keys in block.items()}
        for block in rebuilt.keys
    ]


def holds(edges: Sequence[tuple[float, str, bool]], end_s: float) -> tuple[KeyPress, ...]:
    """Holds of keys from their edges in order of time; one without an end lasts to the end."""
    pressed: dict[str, float] = {}
    found: list[KeyPress] = []
    for time_s, key, down in edges:
        if down:
            pressed.setdefault(key, time_s)
        elif key in pressed:
            since = pressed.pop(key)
            found.append(KeyPress(time_s=since, key=key, hold_for_s=time_s - since))
    found += [
        KeyPress(time_s=since, key=key, hold_for_s=end_s - since) for key, since in pressed.items()
    ]
    return tuple(sorted(found, key=lambda press: (press.time_s, press.key)))


def _plain(vector: Array) -> tuple[float, float, float]:
    x, y, z = (float(part) for part in vector)
    return (x, y, z)
