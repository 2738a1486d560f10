"""Trajectories made by hand: what a scorer sees, whichever simulator wrote it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from buildarena_benchmark import Task, builtin_tasks
from buildarena_geometry import Machine
from buildarena_simulation import Bearing, Trajectory

Path = Callable[[np.ndarray], np.ndarray]


def make_trajectory(
    machine: Machine,
    duration_s: float,
    *,
    moved: Path | None = None,
    cargo: Path | None = None,
    cargo_mass: Callable[[np.ndarray], np.ndarray] | None = None,
    heated: Sequence[bool] = (),
    settings: Mapping[str, float | int | str] | None = None,
) -> Trajectory:
    """A trajectory in which all blocks move alike.

    Args:
        machine: Whose blocks.
        duration_s: Its length, seconds.
        moved: Displacement of every block (T, 3) from times (T,).
        cargo: Position of the cargo (T, 3) from times.
        cargo_mass: Mass of the cargo (T,) from times.
        heated: Per cannon, whether it is heated all the time.
        settings: The trajectory's settings.
    """
    time_s = np.arange(round(duration_s * 25) + 1) / 25
    start = np.array([block.center for block in machine.blocks.values()])
    path = np.zeros((len(time_s), 3)) if moved is None else moved(time_s)
    positions = (start[None] + path[:, None]).astype(np.float32)
    quaternions = np.tile(np.array([1, 0, 0, 0], dtype=np.float32), (*positions.shape[:2], 1))
    cannons = [block.id for block in machine.blocks.values() if block.module.kind == "cannon"]
    return Trajectory(
        time_s=time_s,
        block_ids=tuple(machine.blocks),
        positions=positions,
        quaternions=quaternions,
        cargo_position=None if cargo is None else cargo(time_s).astype(np.float32),
        cargo_quaternion=None if cargo is None else quaternions[:, 0],
        cargo_mass=None if cargo_mass is None else cargo_mass(time_s),
        cargo_size=None if cargo is None else (2.5, 2.5, 1.5),
        cannon_ids=tuple(cannons),
        heated=np.tile(np.array(heated, dtype=bool), (len(time_s), 1)),
        joint_peaks=(),
        breaks=(),
        engine="hand",
        engine_version="1",
        simulation_version="1",
        settings=settings or {},
    )


def with_bearing(
    trajectory: Trajectory,
    *,
    ground: object = 0.0,
    south: object = 0.0,
    north: object = 0.0,
    cargo: object = 0.0,
    wheels: object = 0.0,
    wheel_ids: Sequence[str] = (),
) -> Trajectory:
    """The trajectory with vertical forces, each a number or (T,); of wheels (T, W), mass·g."""
    count = len(trajectory.time_s)

    def series(value: object, width: int | None = None) -> np.ndarray:
        shape = (count,) if width is None else (count, width)
        return np.broadcast_to(np.asarray(value, dtype=np.float32), shape).copy()

    bearing = Bearing(
        ground=series(ground),
        terrain=np.column_stack([series(south), series(north)]),
        cargo=series(cargo),
        wheels=series(wheels, len(wheel_ids)),
        wheel_ids=tuple(wheel_ids),
    )
    return replace(trajectory, bearing=bearing)


def with_pieces(trajectory: Trajectory, *groups: Sequence[str], since_s: float = 0.0) -> Trajectory:
    """The trajectory in which groups of blocks come off as pieces at a time."""
    pieces = np.zeros(trajectory.positions.shape[:2], dtype=np.int16)
    for group in groups:
        columns = [trajectory.block_ids.index(block) for block in group]
        for column in columns:
            pieces[trajectory.time_s >= since_s, column] = columns[0]
    return replace(trajectory, pieces=pieces)


@pytest.fixture(scope="session")
def tasks() -> dict[str, Task]:
    return dict(builtin_tasks())


@pytest.fixture
def trajectory_of() -> Callable[..., Trajectory]:
    return make_trajectory


@pytest.fixture
def car() -> Machine:
    """Starting block, four wheels with keys, and a key press."""
    machine = Machine()
    machine.act("start", {})
    for face in ("E", "F"):
        machine.act(
            "attach_block_to", {"base_block": "1", "face": face, "new_block": "Small Wooden Block"}
        )
    wheels = []
    for base in ("2", "3"):
        for face in ("A", "B"):
            machine.act(
                "attach_block_to",
                {"base_block": base, "face": face, "new_block": "Small Wooden Block"},
            )
            end = list(machine.blocks)[-1]
            machine.act(
                "attach_block_to", {"base_block": end, "face": "E", "new_block": "Powered Wheel"}
            )
            wheels.append(list(machine.blocks)[-1])
    for wheel in wheels:
        machine.act(
            "add_control_key",
            {"block_id": wheel, "action": "spinning_forward", "new_key": "UpArrow"},
        )
    machine.act("add_control_sequence", {"time": 1.0, "key": "UpArrow", "hold_for": 5.0})
    assert len(wheels) == 4
    return machine


@pytest.fixture
def engine_machine() -> Machine:
    """Starting block and two cannons."""
    machine = Machine()
    machine.act("start", {})
    for face in ("A", "B"):
        machine.act(
            "attach_block_to", {"base_block": "1", "face": face, "new_block": "Water Cannon"}
        )
    return machine
