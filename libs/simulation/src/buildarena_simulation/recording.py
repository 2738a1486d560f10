"""Collects a trial's samples and makes its trajectory."""

import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from buildarena_simulation.control import heated_cannons
from buildarena_simulation.engines.base import CargoPose, quaternion_of
from buildarena_simulation.errors import MachineNotSimulable
from buildarena_simulation.scenario import Scenario
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.model import BoolArray, FloatArray, Structure
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.vectors import turned
from buildarena_simulation.trajectory import (
    Bearing,
    Piloting,
    Setting,
    Trajectory,
    rounded_loads,
    rounded_positions,
    rounded_quaternions,
)

if TYPE_CHECKING:
    from buildarena_simulation.breaking import BreakingModel


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """A sample of a trial that runs, as its trajectory will have it.

    Attributes:
        time_s: Time, seconds.
        is_steered: True while a key is held or still to be pressed, and always with a program.
        cargo: (3,) the cargo's position; None without cargo.
        positions: Returns the tracked blocks' positions, (N, 3).
    """

    time_s: float
    is_steered: bool
    cargo: NDArray[np.float32] | None
    positions: Callable[[], NDArray[np.float32]]


class Recorder:
    """Recorder of the samples of one trial.

    Raises:
        MachineNotSimulable: The scenario tracks an unknown block.
    """

    def __init__(self, structure: Structure, scenario: Scenario) -> None:
        self._structure = structure
        ids = structure.block_ids
        tracked = ids if scenario.tracked_blocks == "all" else scenario.tracked_blocks
        missing = [block for block in tracked if block not in ids]
        if missing:
            raise MachineNotSimulable(f"the machine has no block {missing[0]}, which is tracked")
        self._ids = tuple(tracked)
        self._tracked = np.array([ids.index(block) for block in tracked], dtype=np.int64)
        count, cannons = scenario.sample_count, len(structure.cannons)
        self._time_s = np.zeros(count)
        self._seen: list[tuple[Clusters, Motion]] = []
        self._bearing: list[FloatArray] = []
        self._loads: list[FloatArray] = []
        self._heated = np.zeros((count, cannons), dtype=bool)
        self._cargo_size = scenario.cargo.size if scenario.cargo else None
        self._cargo_shape = scenario.cargo.shape if scenario.cargo else "box"
        self._cargo_position = np.zeros((count, 3))
        self._cargo_quaternion = np.zeros((count, 4))
        self._cargo_mass = np.zeros(count)
        self._row = 0
        self.heated_now: BoolArray = np.zeros(cannons, dtype=bool)

    def record(
        self,
        time_s: float,
        motion: Motion,
        clusters: Clusters,
        cargo: CargoPose | None,
        cargo_mass: float | None,
        *,
        bearing: FloatArray,
        loads: FloatArray,
    ) -> None:
        """Record one instant, and determine the heated cannons from here on."""
        row = self._row
        self._time_s[row] = time_s
        self._seen.append((clusters, motion))
        self._bearing.append(bearing)
        self._loads.append(loads)
        if len(self.heated_now):
            self.heated_now = self._heated_in(clusters, motion)
        self._heated[row] = self.heated_now
        if cargo is not None and cargo_mass is not None:
            self._cargo_position[row] = cargo.position
            self._cargo_quaternion[row] = cargo.quaternion
            self._cargo_mass[row] = cargo_mass
        self._row += 1

    def moment(self, released_s: float) -> Moment:
        """Return the last sample, rounded as in the trajectory.

        Args:
            released_s: Time from which no key is held, seconds.
        """
        last = self._row - 1
        cargo = None if self._cargo_size is None else self._cargo_position[last]
        return Moment(
            time_s=float(self._time_s[last]),
            is_steered=bool(self._time_s[last] < released_s),
            cargo=None if cargo is None else rounded_positions(cargo),
            positions=lambda: rounded_positions(self._poses(last)[0][0]),
        )

    def _heated_in(self, clusters: Clusters, motion: Motion) -> BoolArray:
        structure = self._structure
        shown = motion.points(clusters, structure.shown)
        directions = turned(motion.rotation[clusters.cluster_of], structure.directions)
        return heated_cannons(structure, shown, directions)

    def _runs(self, first: int = 0) -> Iterator[tuple[Clusters, list[Motion]]]:
        """Yield the samples from one on, grouped by unchanged clusters."""
        for _, run in itertools.groupby(self._seen[first:], key=lambda sample: id(sample[0])):
            samples = list(run)
            yield samples[0][0], [motion for _, motion in samples]

    def _pieces(self) -> NDArray[np.int16]:
        """Return the component of each tracked block, by its first block, (T, N)."""
        rows = []
        for clusters, motions in self._runs():
            first = np.array([blocks[0] for blocks in clusters.blocks])
            lowest = np.full(len(clusters), len(self._structure), dtype=np.int64)
            np.minimum.at(lowest, clusters.root, first)
            component = lowest[clusters.root][clusters.cluster_of[self._tracked]]
            rows.append(np.tile(component.astype(np.int16), (len(motions), 1)))
        return np.concatenate(rows)

    def _bearing_of_samples(self) -> Bearing:
        wheels = self._structure.wheels
        rows = np.round(np.array(self._bearing) * 256.0).astype(np.float32) / np.float32(256.0)
        cargo = rows.shape[1] - len(wheels) - 1
        return Bearing(
            ground=rows[:, 0].copy(),
            terrain=rows[:, 1:cargo].copy(),
            cargo=rows[:, cargo].copy(),
            wheels=rows[:, cargo + 1 :].copy(),
            wheel_ids=tuple(self._structure.block_ids[i] for i in wheels),
        )

    def _poses(self, first: int = 0) -> tuple[FloatArray, FloatArray]:
        """Return positions (T, N, 3) and quaternions (T, N, 4) of the tracked blocks, world frame.

        Args:
            first: The sample that they begin with.
        """
        structure, tracked = self._structure, self._tracked
        shown, turns = structure.shown[tracked], structure.rotations[tracked]
        positions, quaternions = [], []
        for clusters, motions in self._runs(first):
            of = clusters.cluster_of[tracked]
            rotation = np.array([motion.rotation for motion in motions])[:, of]
            origin = np.array([motion.position for motion in motions])[:, of]
            positions.append(origin + (rotation @ shown[:, :, None])[..., 0])
            quaternions.append(quaternion_of(rotation @ turns))
        return np.concatenate(positions), np.concatenate(quaternions)

    def finished(
        self,
        *,
        breaking: "BreakingModel",
        piloting: Piloting | None,
        engine: str,
        engine_version: str,
        simulation_version: str,
        settings: Mapping[str, Setting],
    ) -> Trajectory:
        """Return the trajectory of all recorded samples."""
        has_cargo = self._cargo_size is not None
        recorded = slice(self._row)
        turns = self._cargo_quaternion[recorded]
        quaternion = np.where(turns[:, :1] < 0, -turns, turns)
        structure = self._structure
        positions, quaternions = self._poses()
        return Trajectory(
            piloting=piloting,
            time_s=self._time_s[recorded],
            block_ids=self._ids,
            positions=rounded_positions(positions),
            quaternions=rounded_quaternions(quaternions),
            cargo_position=rounded_positions(self._cargo_position[recorded]) if has_cargo else None,
            cargo_quaternion=rounded_quaternions(quaternion) if has_cargo else None,
            cargo_mass=self._cargo_mass[recorded] if has_cargo else None,
            cargo_size=self._cargo_size,
            cargo_shape=self._cargo_shape,
            cannon_ids=tuple(structure.block_ids[i] for i in structure.cannons),
            heated=self._heated[recorded],
            pieces=self._pieces(),
            bearing=self._bearing_of_samples(),
            joint_peaks=breaking.peaks(),
            joint_loads=rounded_loads(np.array(self._loads)),
            breaks=tuple(breaking.breaks),
            events=breaking.all_events(),
            engine=engine,
            engine_version=engine_version,
            simulation_version=simulation_version,
            settings=settings,
        )
