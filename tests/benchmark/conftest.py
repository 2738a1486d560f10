"""Trajectories made by hand: what a scorer sees, whichever simulator wrote it."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path as Folder

import numpy as np
import pytest
from support.machines.building import BLOCK, built
from support.machines.headroom import Presses, drafted
from support.machines.piloted import FASTER_FIRST, experts_machine

from buildarena_benchmark import Task, builtin_tasks, load_task, score
from buildarena_benchmark.experts import expert_designs
from buildarena_geometry import Machine
from buildarena_simulation import Bearing, Trajectory, simulate

Path = Callable[[np.ndarray], np.ndarray]
TASK_FILES = Folder(__file__).parents[1] / "data" / "tasks"


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
    """A trajectory in which all blocks move alike; paths are (T, 3), masses (T,), from times."""
    time_s = np.arange(round(duration_s * 25) + 1) / 25
    start = np.array([block.center_xyz for block in machine.blocks.values()])
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


def wheels_of(machine: Machine) -> list[str]:
    return [block.id for block in machine.blocks.values() if block.module.spins]


def keys_held(time_s: np.ndarray, **held: np.ndarray) -> str:
    """Presses of keys as settings keep them, each held at samples (T,)."""
    presses = []
    for key, samples in held.items():
        edges = np.flatnonzero(np.diff(np.concatenate([[False], samples, [False]]).astype(int)))
        presses += [
            [key, float(time_s[begin]), float(end - begin) / 25]
            for begin, end in zip(edges[::2], edges[1::2], strict=True)
        ]
    return json.dumps(presses)


def rolled(
    machine: Machine, trial: Trajectory, turned: Path, *, keys: str | None = None
) -> Trajectory:
    """The trajectory with its wheels turned by angles (T,); positive ones roll north.

    Unless keys are given, those for forward and backward are held while the wheels turn so.
    """
    speed = np.diff(turned(trial.time_s), append=turned(trial.time_s)[-1])
    keys = keys or keys_held(trial.time_s, UpArrow=speed > 0.0, DownArrow=speed < 0.0)
    half = -turned(trial.time_s) / 2
    w, x = np.cos(half), np.sin(half)
    rows = np.sqrt(0.5) * np.column_stack([w, x, w, x])  # block z axis towards east
    quaternions = trial.quaternions.copy()
    for wheel in wheels_of(machine):
        quaternions[:, trial.block_ids.index(wheel)] = rows
    settings = {**trial.settings, "presses": keys}
    return replace(trial, quaternions=quaternions.astype(np.float32), settings=settings)


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

    terrain = np.column_stack([series(south), series(north)])
    turning = {"wheels": series(wheels, len(wheel_ids)), "wheel_ids": tuple(wheel_ids)}
    bearing = Bearing(ground=series(ground), terrain=terrain, cargo=series(cargo), **turning)
    return replace(trajectory, bearing=bearing)


def with_pieces(trajectory: Trajectory, *groups: Sequence[str], since_s: float = 0.0) -> Trajectory:
    """The trajectory in which groups of blocks come off as pieces at a time."""
    pieces = np.zeros(trajectory.positions.shape[:2], dtype=np.int16)
    for group in groups:
        columns = [trajectory.block_ids.index(block) for block in group]
        for column in columns:
            pieces[trajectory.time_s >= since_s, column] = columns[0]
    return replace(trajectory, pieces=pieces)


def shifted(trajectory: Trajectory, by: object, *blocks: str) -> Trajectory:
    """The trajectory with blocks, or all, moved by (3,) or (T, 3)."""
    columns = [trajectory.block_ids.index(block) for block in blocks or trajectory.block_ids]
    positions = trajectory.positions.copy()
    way = np.broadcast_to(np.asarray(by, dtype=np.float32), (len(positions), 3))
    positions[:, columns] += way[:, None]
    return replace(trajectory, positions=positions)


def lost(trajectory: Trajectory, since: int, columns: object) -> Trajectory:
    """The trajectory in which what is at columns comes off at a sample, in one piece."""
    pieces = trajectory.pieces.copy()
    pieces[since:, columns] = pieces.max() + 1
    return replace(trajectory, pieces=pieces)


def strict(task: Task, **scoring: object) -> Task:
    """The task with other thresholds."""
    return replace(task, scoring=task.scoring.model_copy(update=scoring))


def expert(name: str, presses: Presses | None = None) -> Machine:
    """The expert's machine for a task, driven by other presses if given."""
    task = builtin_tasks()[name]
    if task.takes_programs and presses is None:
        return experts_machine(task)
    modules = "all" if name.startswith("throw") else "workshop"
    return drafted(expert_designs()[name](0), presses, modules=modules)


@cache
def honest(name: str, engine: str = "mujoco") -> tuple[Task, Machine, Trajectory]:
    """A task, the expert's machine for it, and its trial in the exact world."""
    task, machine = builtin_tasks()[name], expert(name)
    trial = simulate(machine, task.scenario, engine)
    assert score(task, machine, trial).success
    return task, machine, trial


@pytest.fixture(params=FASTER_FIRST)
def engine(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="session")
def tasks() -> dict[str, Task]:
    """The built-in tasks, and two whose scorers are tried where they have more to judge."""
    return dict(builtin_tasks()) | {file.stem: load_task(file) for file in TASK_FILES.glob("*")}


@pytest.fixture
def car() -> Machine:
    """Starting block, four wheels with keys, and a key press."""
    corners = (("2", "A", "4"), ("2", "B", "6"), ("3", "A", "8"), ("3", "B", "10"))
    corner_parts = [
        part
        for base, face, end in corners
        for part in ((base, face, BLOCK), (end, "E", "Powered Wheel"))
    ]
    machine = built(("1", "E", BLOCK), ("1", "F", BLOCK), *corner_parts)
    for wheel in wheels_of(machine):
        for way, name in (("forward", "UpArrow"), ("backward", "DownArrow")):
            key = {"block_id": wheel, "action": f"spinning_{way}", "new_key": name}
            assert machine.act("add_control_key", key).ok
    machine.act("add_control_sequence", {"time": 1.0, "key": "UpArrow", "hold_for": 5.0})
    return machine


@pytest.fixture
def engine_machine() -> Machine:
    """Starting block and two cannons."""
    return built(("1", "A", "Water Cannon"), ("1", "B", "Water Cannon"))
