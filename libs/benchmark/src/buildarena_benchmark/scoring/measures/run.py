"""Runs of machines in scenarios, as scorers and measures read them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.scoring.measures.components import Mask, joined_to_start
from buildarena_benchmark.scoring.measures.series import Series, rotations, starting_block
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory
from buildarena_simulation.trajectory import Bearing


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """A machine and its trajectory in a scenario, with what most scorers read.

    Attributes:
        scenario: The scenario, as it was simulated.
        trajectory: T samples of N tracked blocks.
    """

    scenario: Scenario
    machine: Machine
    trajectory: Trajectory

    @cached_property
    def joined(self) -> Mask:
        """Which tracked blocks are joined to the starting block, (T, N), see `joined_to_start`."""
        return joined_to_start(self.machine, self.trajectory)

    @cached_property
    def start(self) -> int:
        """The starting block's index among the tracked blocks."""
        return starting_block(self.machine, self.trajectory)

    @cached_property
    def positions(self) -> Series:
        """Places of the tracked blocks, (T, N, 3), units."""
        return self.trajectory.positions.astype(np.float64)

    @cached_property
    def path(self) -> Series:
        """Places of the starting block, (T, 3), units."""
        return np.ascontiguousarray(self.positions[:, self.start])

    @property
    def block_masses(self) -> Series:
        """Masses of the tracked blocks, (N,), mass units."""
        blocks = self.machine.blocks
        return np.array([blocks[block].module.mass for block in self.trajectory.block_ids])

    @property
    def time_s(self) -> Series:
        """Times of the samples, (T,), seconds."""
        return self.trajectory.time_s

    @cached_property
    def cargo_path(self) -> Series:
        """Places of the cargo's centre, (T, 3), units; of a run with a cargo."""
        assert self.trajectory.cargo_position is not None  # noqa: S101 - the caller looked
        return self.trajectory.cargo_position.astype(np.float64)

    @cached_property
    def cargo_turns(self) -> Series:
        """Rotation matrices of the cargo, (T, 3, 3); of a run with a cargo."""
        assert self.trajectory.cargo_quaternion is not None  # noqa: S101 - the caller looked
        return rotations(self.trajectory.cargo_quaternion)

    @property
    def cargo_size(self) -> Series:
        """Edges of the cargo, (3,), units; of a run with a cargo."""
        assert self.trajectory.cargo_size is not None  # noqa: S101 - the caller looked
        return np.array(self.trajectory.cargo_size)

    @property
    def cargo_mass(self) -> NDArray[np.floating]:
        """The cargo's mass, (T,); of a run with a cargo."""
        assert self.trajectory.cargo_mass is not None  # noqa: S101 - the caller looked
        return self.trajectory.cargo_mass

    @property
    def bearing(self) -> Bearing:
        """The forces of contacts; of a run with forces."""
        assert self.trajectory.bearing is not None  # noqa: S101 - the caller looked
        return self.trajectory.bearing
