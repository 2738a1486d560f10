"""A building task as an environment of Gymnasium."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Final

import gymnasium
from gymnasium.error import InvalidAction, ResetNeeded

from buildarena_benchmark import Task
from buildarena_benchmark.environment import (
    DEFAULT_STEPS,
    LONGEST_CALL,
    Environment,
    EpisodeOverError,
    Limits,
    Snapshot,
    call_text,
)
from buildarena_gymnasium.pictures import Picture, check_mode, picture_of, score_values
from buildarena_gymnasium.spaces import ACTION_SPACE, OBSERVATION_SPACE, observe
from buildarena_simulation import DEFAULT_ENGINE

OPTIONS: Final = ("state", "start_seed")
MAX_START_SEED: Final = 2**31


class BuildEnv(gymnasium.Env[str, str]):
    """A task whose actions are tool calls as JSON and whose observations are what a model reads.

    The first observation is the briefing; `info["tools"]` has the tools as JSON. Each action is
    ``{"tool": NAME, "arguments": {...}}``; `submit` ends the episode with a trial, and so does the
    last step that an episode may have, which truncates it. A reward is the increase of
    the episode's worth, so that rewards add up to it. After a trial `info["score"]` has success,
    indicator, metrics and flags.

    Args:
        task: The task, or the name of a built-in one.
        simulator: Name of the engine that simulates machines.
        steps: Maximum number of actions of an episode.
        rounds: Maximum number of submissions; a successful trial ends the episode.
        rewards: Weights by the names of the environment's rewards; by default only success.
        reference: Indicator that is worth 1; by default the task's reference, if any.
        varied_start: Whether machine and cargo start at positions drawn from the environment's
            random numbers; by default all start exactly, as in the service.
        render_mode: ``rgb_array`` for pictures of the machine.

    Raises:
        UnknownChoiceError: Task, simulator or a reward does not exist.
        ValueError: A number is out of range, or the render mode is unknown.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 1}  # noqa: RUF012 - as Gymnasium declares it
    action_space = ACTION_SPACE
    observation_space = OBSERVATION_SPACE

    def __init__(
        self,
        task: Task | str,
        *,
        simulator: str = DEFAULT_ENGINE,
        steps: int = DEFAULT_STEPS,
        rounds: int = 1,
        rewards: Mapping[str, float] | None = None,
        reference: float | None = None,
        varied_start: bool = False,
        render_mode: str | None = None,
    ) -> None:
        self.render_mode = check_mode(render_mode, self.metadata["render_modes"])
        self.environment = Environment(
            task,
            simulator,
            rounds=rounds,
            limits=Limits(steps=steps),
            rewards=rewards,
            reference=reference,
        )
        self._varied_start = varied_start
        self._begun = False
        # Every instance samples independently.
        self.action_space = type(ACTION_SPACE)(LONGEST_CALL, charset=ACTION_SPACE.character_set)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[str, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: Seed of the environment's random numbers.
            options: `start_seed` varies the start of this episode's trials; `state`, a snapshot or
                its document, is the initial state.

        Raises:
            ValueError: An option is unknown or has a wrong type.
        """
        super().reset(seed=seed)
        chosen = dict(options or {})
        for name in chosen:
            if name not in OPTIONS:
                raise ValueError(f"unknown option {name!r}; valid options: {', '.join(OPTIONS)}")
        start_seed = chosen.get("start_seed")
        if start_seed is None and self._varied_start:
            start_seed = int(self.np_random.integers(MAX_START_SEED))
        self.environment.seed = start_seed
        observation = self.environment.reset()
        if "state" in chosen:
            self.environment.restore(chosen["state"])
        self._begun = True
        tools = [tool.as_document() for tool in observation.tools]
        return observe(observation.briefing), {"tools": json.dumps(tools)}

    def step(self, action: str) -> tuple[str, float, bool, bool, dict[str, Any]]:
        """Carry out a tool call, or refuse a text that is not one.

        Raises:
            ResetNeeded: The episode has ended, or none has begun.
            InvalidAction: The action is not text.
            SimulationError: The simulator failed; the same action may be tried again.
        """
        if not self._begun:
            raise ResetNeeded("no episode has begun: call reset first")
        if not isinstance(action, str):
            raise InvalidAction(f"an action is text, not {type(action).__name__}")
        try:
            answer = call_text(self.environment, action, longest=LONGEST_CALL)
        except EpisodeOverError as over:
            raise ResetNeeded(str(over)) from over
        info: dict[str, Any] = {"accepted": answer.accepted, "worth": answer.reward}
        if answer.trial is not None:
            info["score"] = score_values(answer.trial)
        return observe(answer.text), answer.gained, answer.terminated, answer.truncated, info

    def render(self) -> Picture | None:
        """Draw the machine at a trial's start, (320, 480, 3) uint8; white without a machine."""
        if self.render_mode is None:
            return None
        return picture_of(self.environment)

    def state(self) -> Snapshot:
        """Return a snapshot of the episode, which later steps do not change."""
        return self.environment.state()

    def restore(self, state: Snapshot | Mapping[str, Any]) -> None:
        """Restore a state of this task; the cost depends on the difference to the current one.

        Args:
            state: Snapshot of this or another environment, or its document.

        Raises:
            SnapshotError: The state is invalid or another task's.
        """
        self.environment.restore(state)
        self._begun = True
