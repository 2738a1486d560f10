"""Rigs for joints: a heavy mast that stands still, and what moves on it."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
from support.machines.building import BLOCK, KeyedDraft
from support.machines.module_files import like

from buildarena_benchmark.experts.drafting import DOWN
from buildarena_geometry import Catalogue, Machine, module_set
from buildarena_geometry.modules.catalogue import read_modules
from buildarena_simulation import Scenario, Trajectory
from buildarena_simulation.engines import base
from buildarena_simulation.machine import bindings_of, structure_of
from buildarena_simulation.placement import start_of
from buildarena_simulation.rollout import simulate_structure
from buildarena_simulation.scenario import Control
from buildarena_simulation.structure.clusters import Clusters, find_clusters
from buildarena_simulation.structure.model import Structure


@cache
def catalogue() -> Catalogue:
    """The workshop's modules, a mast, a weight of 10, and a wedge of 30°."""
    slope, up = math.sin(math.radians(30)), math.cos(math.radians(30))
    slanted = {"label": "A", "center": [0, 0, 1], "normal": [0, slope, up], "x_axis": [1, 0, 0]}
    drag = {"friction": 0.9, "linear_drag": 0.2, "angular_drag": 0.05}
    physics = {"joint_type": "mount", "mass_at": "center", "structural": True, **drag}
    size = {"mass": 300, "size": [4, 4, 10], "center": [0, 0, 5]}
    mast = {
        **(size | {"faces": [], "physics": physics}),
        "colliders": [{"shape": "box", "from": [-0.2, -0.2, 0], "to": [0.2, 0.2, 9]}],
        "body": [{"shape": "box", "from": [-2, -2, 0], "to": [2, 2, 10]}],
    }
    entries = [
        like(BLOCK, "Mast", grabs=False, **mast),
        like(BLOCK, "Weight", mass=10, grabs=False),
        like(BLOCK, "Wedge", faces=[slanted], grabs=False),
    ]
    extra = read_modules({"version": 1, "modules": entries}, where="rigs")
    return Catalogue((*module_set("workshop").values(), *extra))


class Rig(KeyedDraft):
    """A starting block on a mast, 10.5 above the ground."""

    def __init__(self, modules: Catalogue | None = None) -> None:
        super().__init__()
        self.machine = Machine(catalogue=modules or catalogue())
        self.top = self.start()
        self.attach(self.top, DOWN, "Mast")

    def bound(self, block: str, **keys: str) -> str:
        """Binds actions to keys in place of what they are bound to; the block."""
        for action, key in keys.items():
            self.bind(block, action, key)
        return block

    def tried(self, engine: str, duration_s: float) -> Trajectory:
        """A trial on the ground, its keys pressed as the control sequence says."""
        scenario = Scenario(duration_s=duration_s, control=Control(mode="agent"))
        return tried(self.machine, scenario, engine)

    def bodies(self) -> tuple[Structure, Clusters]:
        """The machine as the simulation sees it."""
        structure = structure_of(self.machine)
        return structure, find_clusters(structure, np.ones(len(structure.members), dtype=bool))


def tried(machine: Machine, scenario: Scenario, engine: str) -> Trajectory:
    """A trial of what cannot break, which starts in touch with the ground: nothing has to land."""
    structure = structure_of(machine)
    members = replace(structure.members, limits=1e4 * structure.members.limits)
    start = start_of(structure, scenario)
    return simulate_structure(
        replace(structure, members=members),
        scenario,
        engine,
        bindings=bindings_of(machine),
        controls=machine.control_sequence,
        start=replace(start, position=start.position - [0.0, 0.0, 0.005]),
    )


def place_of(trajectory: Trajectory, block: str) -> np.ndarray:
    """(T, 3) where a block was."""
    return trajectory.positions[:, trajectory.block_ids.index(block)].astype(float)


def rotation_of(trajectory: Trajectory, block: str) -> np.ndarray:
    """(T, 3, 3) world_from_block."""
    column = trajectory.block_ids.index(block)
    return base.rotation_of(trajectory.quaternions[:, column].astype(float))


def turned_by(trajectory: Trajectory, block: str, axis: tuple[int, int, int]) -> np.ndarray:
    """(T,) angle through which a block has turned about a fixed axis, rad, whole turns counted."""
    rotation = rotation_of(trajectory, block)
    steps = rotation[1:] @ np.transpose(rotation[:-1], (0, 2, 1))
    sine = np.array([m[2, 1] - m[1, 2] for m in steps]) * axis[0]
    sine += np.array([m[0, 2] - m[2, 0] for m in steps]) * axis[1]
    sine += np.array([m[1, 0] - m[0, 1] for m in steps]) * axis[2]
    cosine = np.array([np.trace(m) - 1 for m in steps])
    return np.concatenate([[0.0], np.cumsum(np.arctan2(sine, cosine))])


def period_of(time_s: np.ndarray, swing: np.ndarray) -> float:
    """Mean time between upward passages through the middle of a swing, seconds."""
    level = swing - (swing.max() + swing.min()) / 2
    rows = np.flatnonzero((level[:-1] < 0) & (level[1:] >= 0))
    share = -level[rows] / (level[rows + 1] - level[rows])
    passages = time_s[rows] + share * (time_s[1] - time_s[0])
    return float(np.diff(passages).mean())
