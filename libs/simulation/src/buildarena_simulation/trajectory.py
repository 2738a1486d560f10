"""Result of a trial: poses at 25 Hz, cargo, heating, joint loads and breaks."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

Setting = float | int | str

POSE_GRAIN: Final = 2.0**-14
"""Resolution of positions (6e-5 units), so that they compress well and round-trip."""

QUATERNION_GRAIN: Final = 2.0**-18
"""Resolution of quaternions' components (4e-6)."""

LOAD_GRAIN: Final = 2.0**-9
"""Resolution of shares of strength in series (0.2 %)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointPeak:
    """The largest load of a joint while it held.

    Attributes:
        joint: Name of the joint: "1-2", "brace 7", …
        force: Largest force, mass·g.
        moment: Largest moment, mass·g·unit.
        ratio: Largest share of its strength, 1 at a break.
    """

    joint: str
    kind: str
    force: float
    moment: float
    ratio: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Break:
    """A joint that broke.

    Attributes:
        time_s: Seconds.
        joint: Name of the joint.
        ratio: Its load over its strength.
        cargo_mass: Mass of the cargo at that time, mass units; None without cargo.
    """

    time_s: float
    joint: str
    kind: str
    ratio: float
    cargo_mass: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """A commanded release or grab; a break is not an event.

    Attributes:
        time_s: Seconds.
        what: "decoupled", "grabbed", "released", or "slipped" if a load tore a hold open.
        joint: Joint that was released, or the id of the block that holds.
        held: Held object: the id of a block, "cargo", "ground" or "terrain 1"; "" for a joint.
    """

    time_s: float
    what: str
    joint: str
    held: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bearing:
    """Vertical forces of contacts and grips at T instants, each the mean over a moment, mass·g.

    Here g is the scenario's gravity: a mass that rests weighs its own figure.
    Upwards is positive. K terrain boxes, W wheels. Arrays are read-only.

    Attributes:
        ground: (T,) float32, of the ground on the machine.
        terrain: (T, K) float32, of each terrain box on the machine.
        cargo: (T,) float32, of the machine on the cargo.
        wheels: (T, W) float32, of ground and terrain on each wheel.
        wheel_ids: (W,) ids of the wheels.
    """

    ground: NDArray[np.float32]
    terrain: NDArray[np.float32]
    cargo: NDArray[np.float32]
    wheels: NDArray[np.float32]
    wheel_ids: tuple[str, ...]

    def __post_init__(self) -> None:
        """Check that the arrays fit together, and make them read-only."""
        count = len(self.ground)
        shapes = {
            "ground": (count,),
            "terrain": (count, self.terrain.shape[-1]),
            "cargo": (count,),
            "wheels": (count, len(self.wheel_ids)),
        }
        _close(self, shapes)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Piloting:
    """Senses and commands of a program at T instants. Arrays are read-only.

    Attributes:
        sense_names: (S,) names in the program: "position.x", "marks.goal.relative.x".
        senses: (T, S) float32; not a number at the last instant, which has no command.
        action_names: (A,) actions of blocks that were ever commanded: "7.spinning_forward".
        answers: (T, A) float32, level of each, 0 to 1.
    """

    sense_names: tuple[str, ...]
    senses: NDArray[np.float32]
    action_names: tuple[str, ...]
    answers: NDArray[np.float32]

    def __post_init__(self) -> None:
        """Check that the arrays fit together, and make them read-only."""
        count = len(self.senses)
        shapes = {
            "senses": (count, len(self.sense_names)),
            "answers": (count, len(self.action_names)),
        }
        _close(self, shapes)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trajectory:
    """The record of one trial: T instants, N tracked blocks, C cannons, J joints.

    Positions are the points shown to models as the blocks' positions; with a block's quaternion
    (world_from_block) they give its pose: the block's root lies at
    `position - rotation @ module.center`. Arrays are read-only.

    Attributes:
        time_s: (T,) float64, seconds.
        block_ids: (N,) ids of the tracked blocks.
        positions: (T, N, 3) float32, world frame, units.
        quaternions: (T, N, 4) float32, world_from_block as (w, x, y, z).
        cargo_position: (T, 3) float32, the cargo's centre; None without cargo.
        cargo_quaternion: (T, 4) float32; None without cargo.
        cargo_mass: (T,) float64, mass units; None without cargo.
        cargo_size: (3,) full extents, units; None without cargo.
        cargo_shape: "ball" for one whose diameter the extents are, else "box".
        cannon_ids: (C,) ids of all cannons.
        heated: (T, C) bool, true for cannons that a flame touches.
        pieces: (T, N) int16, piece of each tracked block: the index of the first of the machine's
            blocks in it. Blocks connected by joints or axles are one piece. None if the trial ran
            outside the built-in simulators.
        bearing: Supports of the machine and its loads; None if the trial ran outside the built-in
            simulators.
        joint_peaks: Peak load of each joint.
        joint_loads: (T, J) float32, the largest load of each joint since the instant before, as a
            share of its strength, in the order of `joint_peaks`: above 1 where it broke, 0 from
            then on. None if the trial ran outside the built-in simulators, and in files of schemas
            1 and 2.
        breaks: In order of time.
        events: Commanded releases and grabs, in order of time.
        piloting: Senses and commands of its program; None without a program.
        engine: Name of the engine.
        engine_version: Version of the engine's library.
        simulation_version: Version of the shared model.
        settings: All of the set-up that can change a trajectory.
    """

    time_s: NDArray[np.float64]
    block_ids: tuple[str, ...]
    positions: NDArray[np.float32]
    quaternions: NDArray[np.float32]
    cargo_position: NDArray[np.float32] | None
    cargo_quaternion: NDArray[np.float32] | None
    cargo_mass: NDArray[np.float64] | None
    cargo_size: tuple[float, float, float] | None
    cannon_ids: tuple[str, ...]
    heated: NDArray[np.bool_]
    joint_peaks: tuple[JointPeak, ...]
    breaks: tuple[Break, ...]
    engine: str
    engine_version: str
    simulation_version: str
    settings: Mapping[str, Setting]
    pieces: NDArray[np.int16] | None = None
    bearing: Bearing | None = None
    joint_loads: NDArray[np.float32] | None = None
    events: tuple[Event, ...] = ()
    piloting: Piloting | None = None
    cargo_shape: str = "box"

    def first(self, count: int) -> Self:
        """Return its first instants, with what broke or was let go until then.

        Args:
            count: Number of instants; all of them if it has fewer.
        """
        if count >= len(self.time_s):
            return self
        end_s = self.time_s[count - 1]
        return replace(
            self,
            **_first(self, count),
            bearing=self.bearing and replace(self.bearing, **_first(self.bearing, count)),
            piloting=self.piloting and replace(self.piloting, **_first(self.piloting, count)),
            breaks=tuple(event for event in self.breaks if event.time_s <= end_s),
            events=tuple(event for event in self.events if event.time_s <= end_s),
        )

    def __post_init__(self) -> None:
        """Check that the arrays fit together, and make them read-only."""
        count, blocks = len(self.time_s), len(self.block_ids)
        shapes: dict[str, tuple[int, ...]] = {
            "positions": (count, blocks, 3),
            "quaternions": (count, blocks, 4),
            "cargo_position": (count, 3),
            "cargo_quaternion": (count, 4),
            "cargo_mass": (count,),
            "heated": (count, len(self.cannon_ids)),
            "pieces": (count, blocks),
            "joint_loads": (count, len(self.joint_peaks)),
        }
        if self.piloting is not None and len(self.piloting.senses) != count:
            raise ValueError(f"piloting has {len(self.piloting.senses)} instants, not {count}")
        _close(self, shapes)


def _first(holder: Bearing | Piloting | Trajectory, count: int) -> dict[str, Any]:
    """Return the beginnings of the arrays that are present, by name."""
    arrays = {field.name: getattr(holder, field.name) for field in fields(holder)}
    return {name: a[:count] for name, a in arrays.items() if isinstance(a, np.ndarray)}


def _close(holder: Bearing | Piloting | Trajectory, shapes: Mapping[str, tuple[int, ...]]) -> None:
    """Check the shapes of the arrays that are present, and make all of them read-only.

    Raises:
        ValueError: One has another shape.
    """
    for name, shape in shapes.items():
        array = getattr(holder, name)
        if array is not None and array.shape != shape:
            raise ValueError(f"{name} has shape {array.shape}, expected {shape}")
    for field in fields(holder):
        value = getattr(holder, field.name)
        if isinstance(value, np.ndarray):
            value.setflags(write=False)


def rounded_positions(positions: NDArray[np.float64]) -> NDArray[np.float32]:
    """Round positions as they are stored."""
    return (np.round(positions / POSE_GRAIN) * POSE_GRAIN).astype(np.float32)


def rounded_quaternions(quaternions: NDArray[np.float64]) -> NDArray[np.float32]:
    """Round quaternions as they are stored."""
    return (np.round(quaternions / QUATERNION_GRAIN) * QUATERNION_GRAIN).astype(np.float32)


def rounded_loads(loads: NDArray[np.float64]) -> NDArray[np.float32]:
    """Round shares of strength as they are stored: up, so a breaking load still shows as one."""
    return (np.ceil(loads / LOAD_GRAIN) * LOAD_GRAIN).astype(np.float32)
