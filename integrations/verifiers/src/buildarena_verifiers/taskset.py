"""Rows and rewards: which tasks are played, and what a rollout is worth."""

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
"""Where a trace's `info` keeps how its episode ended."""


class BuildData(vf.TaskData):
    """What one row says: the episode, and the briefing as its prompt."""

    task: str
    simulator: str
    rounds: int
    steps: int
    start_seed: int | None


class BuildState(vf.State):
    """What a rollout holds while it is played."""

    _seat: Seat | None = PrivateAttr(default=None)


class BuildTaskConfig(vf.TaskConfig):
    """Settings of trials; they can't change a score.

    Weights of rewards are the framework's own setting: ``rewards.indicator.weight``.

    Attributes:
        processes: Processes that try machines, for all rollouts of a program together; None for
            one for each core that it may use.
        trial_timeout_s: Seconds after which a trial is broken off.
        until_decided: Ends trials when they are decided: rewards and flags are those of the whole
            trial, other metrics of what was seen until then.
    """

    processes: int | None = Field(None, ge=1)
    trial_timeout_s: float = Field(600.0, gt=0)
    until_decided: bool = False

    @property
    def trials(self) -> tuple[int | None, float, bool]:
        """What `RUNNERS` is asked for."""
        return self.processes, self.trial_timeout_s, not self.until_decided


class BuildTasksetConfig(vf.TasksetConfig):
    """Which episodes there are.

    Attributes:
        tasks: Names of tasks, all by default.
        simulator: Name of the engine that tries machines.
        rounds: How often a builder may submit.
        steps: Calls that it may make.
        start_seeds: A row for each, with machine and cargo started a little elsewhere; by default
            one row that starts exactly, as the service does.
        task: Settings of trials and weights of rewards.
    """

    tasks: list[str] = Field(default_factory=lambda: list(builtin_tasks()))
    simulator: str = DEFAULT_ENGINE
    rounds: int = Field(1, ge=1)
    steps: int = Field(DEFAULT_STEPS, ge=1)
    start_seeds: list[int] = Field(default_factory=list)
    task: BuildTaskConfig = BuildTaskConfig()


class BuildTask(vf.Task[BuildData, BuildState, BuildTaskConfig]):
    """An episode: set up for each rollout anew, finalized by a submission, scored by name.

    The rewards are those of the environment, success alone unless weights say otherwise. They are
    read from the trace's record, so that replays of traces need no physics.
    """

    async def setup(
        self,
        trace: vf.Trace[Any, Any, Any],
        runtime: vf.Runtime,  # noqa: ARG002 - the framework's signature
    ) -> None:
        """Makes the rollout's own episode.

        Raises:
            TypeError: Another harness plays it, which has none of the tools.
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
        """Submits what there is, whatever ended the rollout, and records how it ended."""
        seat = seat_of(trace)
        await seat.end()
        trace.info[RECORD] = seat.record()

    @vf.reward(weight=1.0)
    async def success(self, trace: vf.Trace[Any, Any, Any]) -> float:
        """1 when the best trial met the criterion and nothing disqualifies it."""
        return _reward(trace, "success")

    @vf.reward(weight=0.0)
    async def indicator(self, trace: vf.Trace[Any, Any, Any]) -> float:
        """The best trial's indicator over the built-in expert's."""
        return _reward(trace, "indicator")

    @vf.reward(weight=0.0)
    async def accepted_share(self, trace: vf.Trace[Any, Any, Any]) -> float:
        """Accepted actions as a share of those and the refused ones."""
        return _reward(trace, "accepted_share")

    @vf.reward(weight=0.0)
    async def constraint_progress(self, trace: vf.Trace[Any, Any, Any]) -> float:
        """The share of the task's constraints that the machine meets."""
        return _reward(trace, "constraint_progress")

    @vf.metric
    async def build(self, trace: vf.Trace[Any, Any, Any]) -> dict[str, float]:
        """Figures of the episode that are no rewards."""
        record = trace.info[RECORD]
        return {
            "raw_indicator": float(record["score"]["indicator"]),
            "parts": float(record["score"]["metrics"]["parts"]),
            "steps": float(record["steps"]),
            "refused": float(record["refused"]),
        }


class BuildTaskset(vf.Taskset[BuildTask, BuildTasksetConfig]):  # type: ignore[type-var] # state and settings of our own are allowed
    """BuildArena's tasks, a row for each and for each start."""

    def load(self) -> Iterator[BuildTask]:
        """The rows, in the order of the tasks' names as they were given.

        Raises:
            UnknownChoiceError: A task or the simulator does not exist.
        """
        config = self.config
        starts: list[int | None] = [*config.start_seeds] or [None]
        for name in config.tasks:
            for start in starts:
                yield BuildTask(_row(config, name, start), config.task)


def seat_of(trace: vf.Trace[Any, Any, Any]) -> Seat:
    """The episode of a rollout.

    Raises:
        TypeError: The rollout is not of our taskset.
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
