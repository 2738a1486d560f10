"""Rewards by name: the worth of an episode so far, each between 0 and 1 except the indicator.

Each is a function of the episode's state and not of the way there, so that a builder who goes
in circles earns nothing by it. Success and indicator are known after a trial; the other two shape
the way there, are off unless asked for, and are not figures of the benchmark.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from buildarena_benchmark import Task
from buildarena_benchmark.constraints import share_of_constraints
from buildarena_benchmark.environment.errors import UnknownChoiceError
from buildarena_benchmark.environment.trials.trials import Trial
from buildarena_benchmark.flags import is_disqualified
from buildarena_geometry import Machine


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """Progress of an episode.

    Attributes:
        reference: The indicator that is worth 1.
        machine: The machine that would be submitted now; None where there is none.
        changes: Accepted actions that changed a machine.
        trial: The best trial so far, if any.
    """

    task: Task
    reference: float
    machine: Machine | None
    changes: int
    refused: int
    trial: Trial | None


Reward = Callable[[Progress], float]


def success(progress: Progress) -> float:
    """Return 1 if the best trial met the task's criterion without disqualification, otherwise 0."""
    return float(progress.trial is not None and progress.trial.counts)


def indicator(progress: Progress) -> float:
    """Return the best trial's indicator over the task's reference, from 0; it may exceed 1.

    A trial that failed the criterion keeps its indicator, a disqualified one has none.
    """
    trial = progress.trial
    if trial is None or is_disqualified(trial.score.flags):
        return 0.0
    return max(0.0, trial.score.indicator) / progress.reference


def accepted_share(progress: Progress) -> float:
    """Return accepted actions that changed something, as a share of those and the refused ones.

    Questions count on neither side. 0 before the first.
    """
    attempts = progress.changes + progress.refused
    return progress.changes / attempts if attempts else 0.0


def constraint_progress(progress: Progress) -> float:
    """Return the share of the task's constraints that the machine meets now.

    Counted in the order in which they are checked, up to the first that is broken.
    """
    if progress.machine is None:
        return 0.0
    return share_of_constraints(progress.task, progress.machine)


REWARDS: Final[Mapping[str, Reward]] = MappingProxyType(
    {
        reward.__name__: reward
        for reward in (success, indicator, accepted_share, constraint_progress)
    }
)
"""All rewards by name."""
TERMINAL: Final = frozenset({"success", "indicator"})
"""Those that only a trial can change."""
DEFAULT_WEIGHTS: Final[Mapping[str, float]] = MappingProxyType({"success": 1.0})
"""Default rewards of an environment."""


def checked_weights(
    weights: Mapping[str, float], choices: Collection[str] = REWARDS
) -> Mapping[str, float]:
    """Return the weights, if every one is of a reward that can be chosen.

    Raises:
        UnknownChoiceError: One is not.
    """
    for name in weights:
        if name not in choices:
            raise UnknownChoiceError("reward", name, choices)
    return MappingProxyType({name: float(weight) for name, weight in weights.items()})


def weighed(weights: Mapping[str, float], progress: Progress) -> float:
    """Return the sum of the rewards, each times its weight."""
    return sum(weight * REWARDS[name](progress) for name, weight in weights.items())
