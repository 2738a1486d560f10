"""The environment of verifiers for this taskset and harness."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from typing import Any

import verifiers.v1 as vf

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.environment import REWARDS, UnknownChoiceError
from buildarena_simulation import DEFAULT_ENGINE
from buildarena_verifiers.taskset import BuildTaskConfig, BuildTasksetConfig
from buildarena_verifiers.trial_runners import RUNNERS

ID = "buildarena_verifiers"


class BuildEnvConfig(vf.EnvConfig):
    """Settings of the environment, whose harness runs in this process without a sandbox."""

    agent: vf.AgentConfig = vf.AgentConfig(runtime=vf.SubprocessConfig())


class BuildEnv(vf.Env[BuildEnvConfig]):
    """An environment whose rollouts share only running engines."""

    async def run(self, task: vf.Task[Any, Any, Any], agents: vf.Agents) -> None:
        """Let the agent play the task."""
        await agents.agent.run(task)

    async def start(self) -> None:
        """Hold the engines while rollouts are served."""
        RUNNERS.hold(*self._trials)

    async def stop(self) -> None:
        """End the engines' processes if no other environment uses them."""
        await asyncio.to_thread(RUNNERS.release, *self._trials)

    @property
    def _trials(self) -> tuple[int | None, float, bool]:
        config = self.config.taskset.task
        return (config if isinstance(config, BuildTaskConfig) else BuildTaskConfig()).trials


def load_environment(
    tasks: Sequence[str] | str | None = None,
    simulator: str = DEFAULT_ENGINE,
    *,
    rewards: Mapping[str, float] | None = None,
    processes: int | None = None,
    trial_timeout_s: float = 600.0,
    until_decided: bool = False,
    **episodes: Any,
) -> BuildEnv:
    """Return an environment, for programs without a configuration.

    Args:
        tasks: Names of tasks, or one; all by default.
        simulator: Name of the engine that simulates machines.
        rewards: Weights by the names of the environment's rewards; by default only success.
        processes: Number of simulating processes; by default one for each core.
        trial_timeout_s: Timeout of a trial, seconds.
        until_decided: Whether to end decided trials early, see `BuildTaskConfig`.
        episodes: `rounds`, `steps` and `start_seeds`, see `BuildTasksetConfig`.

    Raises:
        UnknownChoiceError: A task, the simulator or a reward does not exist.
        ValueError: A number is out of range.
    """
    names = [tasks] if isinstance(tasks, str) else list(tasks or builtin_tasks())
    taskset = BuildTasksetConfig(
        id=ID,
        tasks=names,
        simulator=simulator,
        **episodes,
        task=BuildTaskConfig(
            processes=processes,
            trial_timeout_s=trial_timeout_s,
            until_decided=until_decided,
            rewards={} if rewards is None else _weights(rewards),
        ),
    )
    environment = BuildEnv(BuildEnvConfig(taskset=taskset))
    list(environment.taskset)
    return environment


def _weights(rewards: Mapping[str, float]) -> dict[str, vf.RewardFunctionConfig]:
    for name in rewards:
        if name not in REWARDS:
            raise UnknownChoiceError("reward", name, REWARDS)
    return {name: vf.RewardFunctionConfig(weight=rewards.get(name, 0.0)) for name in REWARDS}
