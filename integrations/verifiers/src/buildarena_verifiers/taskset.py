"""Rows and rewards: the tasks to play, and the worth of a rollout."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import verifiers.v1 as vf
from pydantic import Field, PrivateAttr

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.environment import DEFAULT_STEPS, Environment, Limits
from buildarena_simulation import DEFAULT_ENGINE
from buildarena_verifiers.harness_config import BuildHarnessConfig
from buildarena_verifiers.rollout import Seat
from buildarena_verifiers.trial_runners import RUNNERS

RECORD = "buildarena"
"""Key of the episode's results in a trace's `info`."""


class BuildData(vf.TaskData):
    """A row: the settings of an episode, and the briefing as its prompt."""

    task: str
    simulator: str
    rounds: int
    steps: int
    start_seed: int | None


class BuildState(vf.State):
    """State of a rollout while it is played."""

    _seat: Seat | None = PrivateAttr(default=None)


class BuildTaskConfig(vf.TaskConfig):
    """Settings of trials; they can't change a score.

    Weights of rewards are the framework's own setting: ``rewards.indicator.weight``.

    Attributes:
        processes: Number of simulating processes, for all rollouts of a program together; None for
            one for each available core.
        trial_timeout_s: Timeout of a trial, seconds.
        until_decided: Whether to end decided trials early: rewards and flags are those of the
            complete trial, other metrics those of its simulated part.
    """

    processes: int | None = Field(None, ge=1)
    trial_timeout_s: float = Field(600.0, gt=0)
    until_decided: bool = False

    @property
    def trials(self) -> tuple[int | None, float, bool]:
        """Arguments of `RUNNERS`."""
        return self.processes, self.trial_timeout_s, not self.until_decided


class BuildTasksetConfig(vf.TasksetConfig):
    """Settings of the episodes.

    Attributes:
        tasks: Names of tasks, all by default.
        simulator: Name of the engine that simulates machines.
        rounds: Maximum number of submissions.
        steps: Maximum number of calls.
        start_seeds: Seeds of a perturbed start of machine and cargo, a row for each; by default one
            row with the exact start, as in the service.
        task: Settings of trials and weights of rewards.
    """

    tasks: list[str] = Field(default_factory=lambda: list(builtin_tasks()))
    simulator: str = DEFAULT_ENGINE
    rounds: int = Field(1, ge=1)
    steps: int = Field(DEFAULT_STEPS, ge=1)
    start_seeds: list[int] = Field(default_factory=list)
    task: BuildTaskConfig = BuildTaskConfig()


class BuildTask(vf.Task[BuildData, BuildState, BuildTaskConfig]):
    """An episode: set up for each rollout, finalized by a submission, scored by name.

    The rewards are those of the environment, by default only success. They are read from the
    trace's record, so that replays of traces need no physics.
    """

    async def setup(
        self,
        trace: vf.Trace[Any, Any, Any],
        runtime: vf.Runtime,  # noqa: ARG002 - the framework's signature
    ) -> None:
        """Create the rollout's episode.

        Raises:
            TypeError: The harness is another one, without the tools.
        """
        harness = trace.agent.config.harness
        if not isinstance(harness, BuildHarnessConfig):
            raise TypeError(
                f"the harness {getattr(harness, 'id', None)!r} has no building tools: choose "
                "buildarena_verifiers"
            )
        runner = RUNNERS.get(*self.config.trials)
        environment = _environment(self.data, tries=runner.pool.try_machine)
        trace.state._seat = Seat(environment, runner)  # noqa: SLF001 - private to serialization

    async def finalize(
        self,
        trace: vf.Trace[Any, Any, Any],
        runtime: vf.Runtime,  # noqa: ARG002 - the framework's signature
    ) -> None:
        """Submit the current machine, however the rollout ended, and record the results."""
        seat = seat_of(trace)
        await seat.end()
        trace.info[RECORD] = seat.record()

    @vf.reward(weight=1.0)
    async def success(self, trace: vf.Trace[Any, Any, Any]) -> float:
        """Return 1 if the best trial met the criterion and was not disqualified, otherwise 0."""
        return _reward(trace, "success")

    @vf.reward(weight=0.0)
    async def indicator(self, trace: vf.Trace[Any, Any, Any]) -> float:
        """Return the best trial's indicator divided by the built-in expert's."""
        return _reward(trace, "indicator")

    @vf.reward(weight=0.0)
    async def accepted_share(self, trace: vf.Trace[Any, Any, Any]) -> float:
        """Return the share of accepted actions."""
        return _reward(trace, "accepted_share")

    @vf.reward(weight=0.0)
    async def constraint_progress(self, trace: vf.Trace[Any, Any, Any]) -> float:
        """Return the share of the task's constraints that the machine meets."""
        return _reward(trace, "constraint_progress")

    @vf.metric
    async def build(self, trace: vf.Trace[Any, Any, Any]) -> dict[str, float]:
        """Return figures of the episode other than rewards."""
        record = trace.info[RECORD]
        return {
            "raw_indicator": float(record["score"]["indicator"]),
            "parts": float(record["score"]["metrics"]["parts"]),
            "steps": float(record["steps"]),
            "refused": float(record["refused"]),
        }


class BuildTaskset(vf.Taskset[BuildTask, BuildTasksetConfig]):  # type: ignore[type-var] # its own state and settings are allowed
    """BuildArena's tasks, a row for each and for each start."""

    def load(self) -> Iterator[BuildTask]:
        """Yield the rows, in the order of the tasks' names.

        Raises:
            UnknownChoiceError: A task or the simulator does not exist.
        """
        config = self.config
        starts: list[int | None] = [*config.start_seeds] or [None]
        for name in config.tasks:
            for start in starts:
                yield BuildTask(_row(config, name, start), config.task)


def seat_of(trace: vf.Trace[Any, Any, Any]) -> Seat:
    """Return the episode of a rollout.

    Raises:
        TypeError: The rollout is of another taskset.
    """
    seat = getattr(trace.state, "_seat", None)
    if not isinstance(seat, Seat):
        raise TypeError("this harness plays the taskset buildarena_verifiers only")
    return seat


def _row(config: BuildTasksetConfig, name: str, start: int | None) -> BuildData:
    data = BuildData(  # type: ignore[call-arg] # the one left out has a default
        task=name,
        simulator=config.simulator,
        rounds=config.rounds,
        steps=config.steps,
        start_seed=start,
    )
    environment = _environment(data)
    task = environment.task.name
    label = task if start is None else f"{task} from {start}"
    prompt = environment.observation.briefing
    return data.model_copy(update={"task": task, "id": label, "name": label, "prompt": prompt})


def _environment(data: BuildData, **more: Any) -> Environment:
    return Environment(
        data.task,
        data.simulator,
        seed=data.start_seed,
        rounds=data.rounds,
        limits=Limits(steps=data.steps),
        **more,
    )


def _reward(trace: vf.Trace[Any, Any, Any], name: str) -> float:
    return float(trace.info[RECORD]["rewards"][name])
