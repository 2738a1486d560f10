"""What is known of a machine that succeeded, which checks look at."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark import Score, Task
from buildarena_benchmark.flags import is_disqualified
from buildarena_geometry import Machine
from buildarena_simulation import Trajectory

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Evidence:
    """What is known of a success."""

    task: Task
    machine: Machine
    trials: Mapping[str, tuple[Score, Trajectory]]
    robust_share: float | None = None

    @property
    def score(self) -> Score:
        """The first trial's score."""
        return next(iter(self.trials.values()))[0]

    @property
    def trajectory(self) -> Trajectory:
        """The first trial's trajectory."""
        return next(iter(self.trials.values()))[1]

    def rows(self, kind: str) -> list[int]:
        """Indices of the tracked blocks of a kind."""
        ids = self.trajectory.block_ids
        return [i for i, b in enumerate(ids) if self.machine.blocks[b].module.kind == kind]


Check = Callable[[Evidence], bool]


def counts(result: Score) -> bool:
    """Whether a trial succeeded and nothing disqualifies it."""
    return result.success and not is_disqualified(result.flags)


def path_of(trajectory: Trajectory) -> Floats:
    """(T, N, 3) float64, where its blocks were, units."""
    return np.asarray(trajectory.positions, dtype=np.float64)
