"""Input of a controller at a tick: poses, joints, wheels, cargo, places, a line."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Any, Final, NamedTuple, get_args

import numpy as np

from buildarena_geometry.modules.joints import MOVING_JOINTS
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.controllers.bodies import Bodies
from buildarena_simulation.engines.base import CargoPose
from buildarena_simulation.errors import ControllerFailed
from buildarena_simulation.line import SENSORS
from buildarena_simulation.scenario import Gate, Mark, Scenario
from buildarena_simulation.sensor_config import SenseKind, Senses
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.model import FloatArray, Structure
from buildarena_simulation.structure.motion import Motion

TICK_S: Final = 1.0 / SAMPLE_RATE_HZ
"""Time between two ticks, seconds."""
_GRAINS: Final = 1e6
"""Resolution of senses, 1/unit: a program must not depend on an engine's last bits."""
_TOUCHES: Final = 1e-3
"""Force above which a block has contact, mass·g."""
_AXES: Final = "xyz"
_AXES_FROM: Final = 6
"""Index of the first axis among the figures of a pose; spins follow."""
_SHOWN: Final = 20


class Snapshot(NamedTuple):
    """State that can be sensed at a tick.

    Attributes:
        time_s: Seconds.
        cargo: None without cargo.
        on_blocks: (N,) upward force of ground and terrain on each block, mass·g.
        fuel_s: Fuel that is left, seconds.
    """

    time_s: float
    clusters: Clusters
    motion: Motion
    cargo: CargoPose | None
    on_blocks: FloatArray
    fuel_s: float


class Sensing:
    """Producer of a program's senses, always in the same order.

    Args:
        scenario: Its places, and its senses with their noise and delay.
        sensors: Ids of further blocks to sense.
        seed: Seed of the noise.

    Attributes:
        layout: Names, in the form of `Program.senses_are`.
        offers: Kinds of senses, in the order of their numbers.
        blocks: Indices of the blocks that the program listed.
        moving: Indices of the blocks whose joints are sensed.
        noise: Standard deviation of each number.

    Raises:
        ControllerFailed: A sensor block is unknown.
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
        self._wheels = [(index, forwards(structure, index)) for index in structure.wheels.tolist()]
        self.moving = [
            index
            for index, part in enumerate(structure.parts)
            if part.physics.joint_type in MOVING_JOINTS and index not in structure.wheels
        ]
        self._count, self.noise = 0, list[float]()
        self.layout = self._laid_out()
        self._draw = np.random.default_rng([seed, 2])
        self._noise, self._is_noisy = np.array(self.noise), any(self.noise)
        self._past: deque[FloatArray] = deque(maxlen=self._senses.delay_ticks + 1)
        self._bodies, self._own = Bodies(structure), list[float]()
        self._kinds = self._readers()

    def read(self, snapshot: Snapshot) -> list[float]:
        """Return the numbers of a tick in order; during the delay, the first ones again."""
        self._bodies.see(snapshot.clusters, snapshot.motion)
        self._own = self._bodies.pose(0)
        numbers: list[float] = []
        for read in self._kinds:
            numbers += read(snapshot)
        now = np.array(numbers, dtype=np.float64)
        if self._is_noisy:
            now += self._noise * self._draw.standard_normal(self._count)
        # As `np.round` does it, which takes several times as long for so few.
        self._past.append(np.rint(now * _GRAINS) / _GRAINS + 0.0)
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
        # The starting block's own pose has no separate name: `sense.position`.
        own = {"pose": self._pose, "axes": self._axes}
        named = [own[kind]() for kind in self.offers if kind in own]
        shared = [kind for kind in self.offers if kind not in own]
        return (named[0] if named else {}) | {kind: layouts[kind]() for kind in shared}

    def _is_offered(self, kind: SenseKind) -> bool:
        """Check if the scenario offers a kind of senses, and has its subject."""
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

    def _readers(self) -> list[Callable[[Snapshot], Iterable[float]]]:
        """Return the reader of each kind that is offered, in order."""
        scenario, bodies = self._scenario, self._bodies
        readers: dict[SenseKind, Callable[[Snapshot], Iterable[float]]] = {
            "pose": lambda _: self._own,
            "axes": lambda _: self._own[_AXES_FROM:],
            "blocks": lambda _: (each for block in self.blocks for each in bodies.pose(block)),
            "joints": lambda _: self._joint_values(),
            "wheels": self._wheel_values,
            "contacts": lambda snapshot: (snapshot.on_blocks[self.blocks] > _TOUCHES).tolist(),
            "cargo": self._cargo_values,
            "marks": lambda snapshot: self._places([m.at(snapshot.time_s) for m in scenario.marks]),
            "gates": lambda _: self._places([(*gate.center, 0.0) for gate in scenario.gates]),
            "gate": lambda _: self._places([next_gate(scenario.gates, self._own[1])]),
            "fuel": lambda snapshot: (snapshot.fuel_s,),
            "line": self._line_values,
        }
        return [readers[kind] for kind in self.offers]

    def _line_values(self, snapshot: Snapshot) -> Iterable[float]:
        """Return 1 for each ground sensor above the line, from left to right, otherwise 0."""
        line = self._scenario.line
        if line is None:
            return ()
        motion, c = snapshot.motion, snapshot.clusters.cluster_of[0]
        aside = line.apart * np.arange(-1, len(SENSORS) - 1)
        sensors = np.column_stack(
            [aside, np.full(len(SENSORS), line.ahead), np.zeros(len(SENSORS))]
        )
        points = motion.position[c] + (self._structure.shown[0] + sensors) @ motion.rotation[c].T
        under: list[bool] = (line.nearest(points)[1] <= line.half_width).tolist()
        return under

    def _joint_values(self) -> Iterator[float]:
        bodies = self._bodies
        for index in self.moving:
            if place_of(self._structure, index) == "angle":
                place, speed = bodies.turn(index), bodies.turning(index)
            else:
                place, speed = bodies.shift(index)
            sign = forwards(self._structure, index)
            yield from (sign * place, sign * speed)

    def _wheel_values(self, snapshot: Snapshot) -> Iterator[float]:
        touching = (snapshot.on_blocks > _TOUCHES).tolist()
        for index, sign in self._wheels:
            yield sign * self._bodies.turning(index)
            yield touching[index]

    def _cargo_values(self, snapshot: Snapshot) -> Iterable[float]:
        if snapshot.cargo is None:
            return ()
        place: list[float] = snapshot.cargo.position.tolist()
        return [*place, *self._offset_from_block(place), *snapshot.cargo.velocity.tolist()]

    def _places(self, centers: Iterable[Sequence[float]]) -> Iterator[float]:
        for center in centers:
            yield from center
            yield from self._offset_from_block(center)

    def _offset_from_block(self, place: Sequence[float]) -> Iterator[float]:
        return (target - origin for target, origin in zip(place, self._own, strict=False))


def next_gate(gates: Sequence[Gate], north: float) -> tuple[float, float, float]:
    """Return the centre of the first gate that lies north of a position, or of the last gate.

    Args:
        gates: Gates in the order in which they are to be passed; at least one.
        north: Northward coordinate of the position, units.
    """
    ahead = next((gate for gate in gates if gate.center[1] > north), gates[-1])
    return (*ahead.center, 0.0)


def forwards(structure: Structure, index: int) -> float:
    """Return the sign that makes a value grow in the direction of a block's forward action."""
    return -1.0 if structure.parts[index].forward_is_clockwise else 1.0


def place_of(structure: Structure, index: int) -> str:
    """Return the sense name of a block's position on its base: a length or an angle."""
    return "length" if structure.parts[index].physics.joint_type == "slider" else "angle"
