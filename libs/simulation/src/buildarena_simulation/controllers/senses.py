"""What a controller is told at a tick: poses, joints, wheels, cargo, places, a line."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, get_args

import numpy as np

from buildarena_geometry.modules.joints import MOVING_JOINTS
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.engines.base import CargoPose
from buildarena_simulation.errors import ControllerFailed
from buildarena_simulation.line import SENSORS
from buildarena_simulation.offered import SenseKind, Senses
from buildarena_simulation.scenario import Gate, Mark, Scenario
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.model import FloatArray, Structure
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.vectors import cross, turned

TICK_S: Final = 1.0 / SAMPLE_RATE_HZ
"""Time between two ticks, seconds."""
_GRAIN: Final = 6
"""Decimals that a program sees: the last bits of an engine are none of its business."""
_TOUCHES: Final = 1e-3
"""Force above which a block has contact, mass·g."""
_AXES: Final = "xyz"
_AXES_FROM: Final = 6
"""Where axes and spins begin among the figures of a pose."""
_SHOWN: Final = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """What there is to be sensed at a tick.

    Attributes:
        time_s: Seconds.
        clusters: The machine's.
        motion: Theirs.
        cargo: The cargo; None without.
        on_blocks: (N,) what ground and terrain exert on each block upwards, mass·g.
        fuel_s: What fuel is left, seconds.
    """

    time_s: float
    clusters: Clusters
    motion: Motion
    cargo: CargoPose | None
    on_blocks: FloatArray
    fuel_s: float


class Sensing:
    """Makes a program's senses, always in the same order.

    Args:
        structure: The machine.
        scenario: Its places, and what it offers, how exactly and how late.
        sensors: Ids of further blocks that the program wants to be told about.
        seed: Draws the noise.

    Attributes:
        layout: The names, as `Program.senses_are` takes them.
        offers: The kinds of senses, in the order of their numbers.
        blocks: Indices of the blocks that the program listed.
        moving: Indices of the blocks of which joints tell.
        noise: Of each number, its standard deviation.

    Raises:
        ControllerFailed: The machine has no such block.
    """

    def __init__(
        self, structure: Structure, scenario: Scenario, sensors: Sequence[str], *, seed: int
    ) -> None:
        self._structure, self._scenario = structure, scenario
        self._senses = scenario.senses or Senses(offers=())
        self.offers = [kind for kind in get_args(SenseKind) if self._is_offered(kind)]
        ids = structure.block_ids
        unknown = next((block for block in sensors if block not in ids), None)
        if unknown is not None:
            raise ControllerFailed(
                f"sensors names block {unknown[:40]!r}; the machine has {', '.join(ids[:_SHOWN])}"
                + (", …" if len(ids) > _SHOWN else "")
            )
        self.blocks = [ids.index(block) for block in dict.fromkeys(sensors)]
        self._told = np.array([0, *self.blocks])
        self.moving = [
            index
            for index, part in enumerate(structure.parts)
            if part.physics.joint_type in MOVING_JOINTS and index not in structure.wheels
        ]
        self._count, self.noise = 0, list[float]()
        self.layout = self._laid_out()
        self._draw = np.random.default_rng([seed, 2])
        self._noisy = np.array(self.noise)
        self._past: deque[FloatArray] = deque(maxlen=self._senses.delay_ticks + 1)
        self._clusters: Clusters | None = None
        self._seats: dict[int, tuple[int, int]] = {}

    def read(self, seen: Seen) -> list[float]:
        """The numbers of a tick, in the order of the layout; the first ones again while late."""
        if seen.clusters is not self._clusters:
            self._clusters, self._seats = seen.clusters, _seats(seen.clusters)
        now = np.fromiter(self._values(seen), dtype=np.float64, count=self._count)
        if self._noisy.any():
            now += self._noisy * self._draw.standard_normal(self._count)
        self._past.append(np.round(now, _GRAIN) + 0.0)
        values: list[float] = self._past[0].tolist()
        return values

    def _laid_out(self) -> dict[str, Any]:
        layouts: dict[SenseKind, Callable[[], Any]] = {
            "blocks": self._blocks_layout,
            "joints": self._joints_layout,
            "wheels": self._wheels_layout,
            "contacts": self._contacts_layout,
            "cargo": self._cargo_layout,
            "marks": partial(self._places_layout, self._scenario.marks),
            "gates": partial(self._places_layout, self._scenario.gates),
            "gate": self._place,
            "fuel": self._number,
            "line": lambda: {sensor: self._number() for sensor in SENSORS},
        }
        # The starting block's own pose has no name of its own: `sense.position`.
        own = {"pose": self._pose, "axes": self._axes}
        named = [own[kind]() for kind in self.offers if kind in own]
        others = [kind for kind in self.offers if kind not in own]
        return (named[0] if named else {}) | {kind: layouts[kind]() for kind in others}

    def _is_offered(self, kind: SenseKind) -> bool:
        """Whether the scenario offers a kind of senses, and has what it is about."""
        about: dict[str, object] = {"cargo": self._scenario.cargo}
        about |= {"marks": self._scenario.marks, "gates": self._scenario.gates}
        about["gate"] = self._scenario.gates
        about["line"] = self._scenario.line
        about["fuel"] = self._scenario.fuel_s is not None
        about["axes"] = "pose" not in self._senses.offers  # which has them
        return kind in self._senses.offers and bool(about.get(kind, True))

    def _blocks_layout(self) -> dict[str, Any]:
        return {self._structure.parts[block].id: self._pose() for block in self.blocks}

    def _joints_layout(self) -> dict[str, Any]:
        return {
            self._structure.parts[index].id: {
                place_of(self._structure, index): self._number("joint"),
                "speed": self._number("joint_speed"),
            }
            for index in self.moving
        }

    def _wheels_layout(self) -> dict[str, Any]:
        return {
            self._structure.parts[index].id: {
                "speed": self._number("joint_speed"),
                "contact": self._number(),
            }
            for index in self._structure.wheels
        }

    def _contacts_layout(self) -> dict[str, Any]:
        return {self._structure.parts[block].id: self._number() for block in self.blocks}

    def _cargo_layout(self) -> dict[str, Any]:
        kinds = {"position": "place", "relative": "place", "velocity": "speed"}
        return {name: self._vector(noise) for name, noise in kinds.items()}

    def _places_layout(self, places: Sequence[Gate | Mark]) -> dict[str, Any]:
        return {place.name: self._place() for place in places}

    def _place(self) -> dict[str, Any]:
        return {"position": self._vector(), "relative": self._vector("place")}

    def _pose(self) -> dict[str, Any]:
        places = {"position": self._vector("place"), "velocity": self._vector("speed")}
        return places | self._axes()

    def _axes(self) -> dict[str, Any]:
        return {
            "up": self._vector("axis"),
            "forward": self._vector("axis"),
            "spin": self._vector("spin"),
            "body_spin": self._vector("spin"),
        }

    def _vector(self, noise: str = "") -> dict[str, int]:
        return {axis: self._number(noise) for axis in _AXES}

    def _number(self, noise: str = "") -> int:
        self.noise.append(self._senses.noise.get(noise, 0.0))  # type: ignore[call-overload]
        self._count += 1
        return self._count - 1

    def _values(self, seen: Seen) -> Iterator[float]:
        poses = self._poses(seen)
        own = poses[0, :3]
        values: dict[SenseKind, Callable[[], Iterable[float]]] = {
            "pose": poses[0].tolist,
            "axes": poses[0, _AXES_FROM:].tolist,
            "blocks": poses[1:].ravel().tolist,
            "joints": lambda: self._joint_values(seen),
            "wheels": lambda: self._wheel_values(seen),
            "contacts": lambda: (seen.on_blocks[self.blocks] > _TOUCHES).astype(float).tolist(),
            "cargo": lambda: _cargo_values(seen, own),
            "marks": lambda: _places((mark.at(seen.time_s) for mark in self._scenario.marks), own),
            "gates": lambda: _places(((*g.center, 0.0) for g in self._scenario.gates), own),
            "gate": lambda: _places([next_gate(self._scenario.gates, own[1])], own),
            "fuel": lambda: (seen.fuel_s,),
            "line": lambda: self._line_values(seen),
        }
        for kind in self.offers:
            yield from values[kind]()

    def _line_values(self, seen: Seen) -> Iterator[float]:
        """Whether the line is below each ground sensor, from left to right."""
        line = self._scenario.line
        if line is None:
            return
        motion, c = seen.motion, seen.clusters.cluster_of[0]
        aside = line.apart * np.arange(-1, len(SENSORS) - 1)
        seats = np.column_stack([aside, np.full(len(SENSORS), line.ahead), np.zeros(len(SENSORS))])
        points = motion.position[c] + (self._structure.shown[0] + seats) @ motion.rotation[c].T
        yield from (line.nearest(points)[1] <= line.half_width).astype(float).tolist()

    def _joint_values(self, seen: Seen) -> Iterator[float]:
        for index in self.moving:
            sign = forwards(self._structure, index)
            sides = self._seats.get(index)
            place, speed = _joint(self._structure, seen, index, sides) if sides else (0.0, 0.0)
            yield from (sign * place, sign * speed)

    def _wheel_values(self, seen: Seen) -> Iterator[float]:
        for index in self._structure.wheels.tolist():
            sides = self._seats.get(index)
            outward = _relative_spin(self._structure, seen, index, sides) if sides else 0.0
            yield forwards(self._structure, index) * outward
            yield float(seen.on_blocks[index] > _TOUCHES)

    def _poses(self, seen: Seen) -> FloatArray:
        """Position, velocity, up, forward, spin and spin in the block's frame, (1 + B, 18)."""
        motion, clusters = seen.motion, seen.clusters
        c = clusters.cluster_of[self._told]
        rotation, spin = motion.rotation[c], motion.spin[c]
        shown = self._structure.shown[self._told]
        position = motion.position[c] + turned(rotation, shown)
        arm = turned(rotation, shown - clusters.center_of_mass[c])
        velocity = motion.velocity[c] + cross(spin, arm)
        own = turned(rotation.transpose(0, 2, 1), spin)
        poses = [position, velocity, rotation[:, :, 2], rotation[:, :, 1], spin, own]
        return np.concatenate(poses, axis=1)


def _cargo_values(seen: Seen, own: FloatArray) -> Iterator[float]:
    if seen.cargo is not None:
        yield from seen.cargo.position.tolist()
        yield from (seen.cargo.position - own).tolist()
        yield from seen.cargo.velocity.tolist()


def _places(centers: Iterable[Sequence[float]], own: FloatArray) -> Iterator[float]:
    for center in centers:
        yield from center
        yield from (np.array(center) - own).tolist()


def next_gate(gates: Sequence[Gate], north: float) -> tuple[float, float, float]:
    """The centre of the first gate that lies north of a place; of the last where none does.

    Args:
        gates: In the order in which they are to be passed; at least one.
        north: Where somebody is, units.
    """
    ahead = next((gate for gate in gates if gate.center[1] > north), gates[-1])
    return (*ahead.center, 0.0)


def forwards(structure: Structure, index: int) -> float:
    """The sign that makes what grows where a block's forward action moves it."""
    return -1.0 if structure.parts[index].forward_is_clockwise else 1.0


def place_of(structure: Structure, index: int) -> str:
    """What a program is told of where a block is on its seat: a length or an angle."""
    return "length" if structure.parts[index].physics.joint_type == "slider" else "angle"


def _seats(clusters: Clusters) -> dict[int, tuple[int, int]]:
    """The clusters of each block that moves on its seat and of that seat; of none that came off."""
    rows = zip(
        clusters.seated.tolist(),
        clusters.parent.tolist(),
        clusters.seated_is_outer.tolist(),
        strict=True,
    )
    return {
        block: (cluster, parent) if outer else (parent, cluster)
        for cluster, (block, parent, outer) in enumerate(rows)
        if parent >= 0
    }


def _relative_spin(structure: Structure, seen: Seen, index: int, sides: tuple[int, int]) -> float:
    """How fast a block turns on its seat about its axis, rad/s."""
    own, base = sides
    axis = seen.motion.rotation[base] @ structure.joints.axes[index]
    return float(axis @ (seen.motion.spin[own] - seen.motion.spin[base]))


def _joint(
    structure: Structure, seen: Seen, index: int, sides: tuple[int, int]
) -> tuple[float, float]:
    """Angle, rad, or shift, units, of a block on its seat, and how fast that grows."""
    own, base = sides
    motion, axis = seen.motion, structure.joints.axes[index]
    back = motion.rotation[base].T
    if place_of(structure, index) == "angle":
        turn = back @ motion.rotation[own]
        lever = np.array(
            [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
        )
        angle = np.arctan2(lever @ axis, np.trace(turn) - 1.0)
        return float(angle), _relative_spin(structure, seen, index, sides)
    point = structure.joints.points[index]
    places, speeds = [], []
    for c in (own, base):
        arm = motion.rotation[c] @ (point - seen.clusters.center_of_mass[c])
        places.append(motion.position[c] + motion.rotation[c] @ point)
        speeds.append(motion.velocity[c] + np.cross(motion.spin[c], arm))
    apart = places[0] - places[1]
    along = motion.rotation[base] @ axis
    turning = np.cross(motion.spin[base], apart)
    return float(along @ apart), float(along @ (speeds[0] - speeds[1] - turning))
