"""Robustness of a machine over repeated trials with small variations."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from buildarena_benchmark.constraints import broken_constraint
from buildarena_benchmark.scores import decision, failed_score, score
from buildarena_benchmark.scoring.scorer import Score
from buildarena_benchmark.tasks.task import Task
from buildarena_geometry import Machine
from buildarena_simulation import MachineNotSimulable, Play, simulate_many


@dataclass(frozen=True, slots=True, kw_only=True)
class Robustness:
    """The scores of repeated trials."""

    seeds: tuple[int, ...]
    scores: tuple["Score", ...]

    @property
    def successes(self) -> int:
        """Number of trials that succeeded."""
        return sum(result.success for result in self.scores)

    @property
    def share(self) -> float:
        """Share of the trials that succeeded, 0 to 1."""
        return self.successes / len(self.scores)


def robustness(
    task: "Task",
    machine: "Machine",
    engine: str,
    seeds: Sequence[int],
    *,
    on_progress: Callable[[float], None] | None = None,
) -> Robustness:
    """Try a machine once per seed, its start varied as a fair repetition would vary it.

    A machine that breaks one of the task's constraints fails every trial without being simulated.

    Args:
        on_progress: Called after each trial with the finished share.
    """
    scores = []
    if broken_constraint(task, machine) is not None:
        scores = [failed_score(task, machine)] * len(seeds)
        return Robustness(seeds=tuple(seeds), scores=tuple(scores))
    plays = (Play(seed=seed, until=decision(task, seed=seed)) for seed in seeds)
    for k, outcome in enumerate(simulate_many(machine, task.scenario, engine, plays=plays), 1):
        if isinstance(outcome, MachineNotSimulable):
            scores.append(failed_score(task, machine))
        else:
            scores.append(score(task, machine, outcome))
        if on_progress:
            on_progress(k / len(seeds))
    return Robustness(seeds=tuple(seeds), scores=tuple(scores))
