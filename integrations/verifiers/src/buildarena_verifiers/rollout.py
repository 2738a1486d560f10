"""A rollout's episode, which shares nothing with other rollouts."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any

from buildarena_benchmark.environment import (
    Answer,
    Environment,
    NothingToSubmitError,
    call,
    counted_trial,
)
from buildarena_benchmark.environment.tools import SUBMIT
from buildarena_geometry.json_texts import read_json
from buildarena_verifiers.trial_runners import TrialRunner


class Seat:
    """An episode that is played from an event loop.

    Args:
        runner: Runner of the episode's trials.
    """

    def __init__(self, environment: Environment, runner: TrialRunner) -> None:
        self.environment = environment
        self._runner = runner
        # A cancelled call may still be running when the rollout is finalized.
        self._lock = threading.Lock()

    @property
    def tools(self) -> list[dict[str, Any]]:
        """The tools in the form of chat completions."""
        return [
            {"type": "function", "function": tool.as_document()}
            for tool in self.environment.observation.tools
        ]

    async def call(self, tool: str, arguments: str) -> Answer:
        """Carry out a tool call.

        Args:
            tool: Name of the tool.
            arguments: The model's arguments, as JSON.

        Raises:
            SimulationError: The simulator failed.
        """
        values = _parse(arguments)
        if tool == SUBMIT.name or self.environment.remaining_steps <= 1:
            return await self._runner.run(lambda: self._call(tool, values))
        return self._call(tool, values)

    async def end(self) -> None:
        """Submit the current machine, unless the episode has ended."""
        if not self.environment.done:
            await self._runner.run(self._end)

    def record(self) -> dict[str, Any]:
        """Return the episode's results as JSON values: rewards by name, score, machine, steps."""
        environment = self.environment
        state = environment.state()
        try:
            machine: Mapping[str, Any] | None = environment.submitted().to_document()
        except NothingToSubmitError:
            machine = None
        trial = counted_trial(environment.task, environment.trials)
        return {
            "task": state.task,
            "task_version": state.task_version,
            "simulator": environment.simulator,
            "start_seed": environment.seed,
            "rewards": dict(environment.named_rewards),
            "score": trial.as_document(),
            "trials": len(environment.trials),
            "steps": state.steps,
            "refused": state.refused,
            "machine": machine,
        }

    def _call(self, tool: str, arguments: object) -> Answer:
        with self._lock:
            return call(self.environment, tool, arguments)

    def _end(self) -> None:
        with self._lock:
            if not self.environment.done:
                self.environment.finish()


def _parse(arguments: str) -> object:
    """Parse arguments; invalid JSON remains a text, which the geometry refuses."""
    if not arguments.strip():
        return None
    try:
        return read_json(arguments)
    except ValueError:
        return arguments
