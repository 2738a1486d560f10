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
    Answer,
    Environment,
    EpisodeOverError,
    Limits,
    Snapshot,
    call_text,
)
from buildarena_gymnasium.pictures import Picture, checked_mode, picture_of, score_told
from buildarena_gymnasium.spaces import ACTION_SPACE, OBSERVATION_SPACE, observed
from buildarena_simulation import DEFAULT_ENGINE

OPTIONS: Final = ("state", "start_seed")
MAX_START_SEED: Final = 2**31


class BuildEnv(gymnasium.Env[str, str]):
    """A task whose actions are tool calls as JSON and whose observations are what a model reads.

    The first observation is the briefing; `info["tools"]` has the tools as JSON. Each action is
    ``{"tool": NAME, "arguments": {...}}``; `submit` ends the episode with a trial, and so does the
    last step that an episode may have, which truncates it. A reward is what the episode is worth
    more than before, so they add up to what it is worth. After a trial `info["score"]` has success,
    indicator, metrics and flags.

    Args:
        task: The task, or the name of a built-in one.
        simulator: Name of the engine that tries machines.
        steps: Actions that an episode may have.
        rounds: How often a builder may submit; a successful trial ends the episode.
        rewards: Weights by the names of the environment's rewards; success alone by default.
        reference: The indicator that is worth 1; the task's reference where there is one.
        varied_start: Whether each episode starts machine and cargo a little elsewhere, drawn from
            the environment's random numbers; by default all start exactly, as in the service.
        render_mode: ``rgb_array`` for pictures of the machine.

    Raises:
        UnknownChoiceError: Task, simulator or a reward does not exist.
        ValueError: A number is out of range, or there is no such render mode.
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
        self.render_mode = checked_mode(render_mode, self.metadata["render_modes"])
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
        # Every instance samples by itself.
        self.action_space = type(ACTION_SPACE)(LONGEST_CALL, charset=ACTION_SPACE.character_set)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[str, dict[str, Any]]:
        """Begins an episode.

        Args:
            seed: Of the environment's random numbers.
            options: `start_seed` varies the start of this episode's trials; `state`, a snapshot or
                its document, is where the episode begins.

        Raises:
            ValueError: There is no such option, or it is not of its kind.
        """
        super().reset(seed=seed)
        chosen = dict(options or {})
        for name in chosen:
            if name not in OPTIONS:
                raise ValueError(f"there is no option {name!r}: choose from {', '.join(OPTIONS)}")
        start_seed = chosen.get("start_seed")
        if start_seed is None and self._varied_start:
            start_seed = int(self.np_random.integers(MAX_START_SEED))
        self.environment.seed = start_seed
        seen = self.environment.reset()
        if "state" in chosen:
            self.environment.restore(chosen["state"])
        self._begun = True
        tools = [tool.as_document() for tool in seen.tools]
        return observed(seen.briefing), {"tools": json.dumps(tools)}

    def step(self, action: str) -> tuple[str, float, bool, bool, dict[str, Any]]:
        """Carries out a tool call; what is no call is a refused one.

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
        return (
            observed(answer.text),
            answer.gained,
            answer.terminated,
            answer.truncated,
            _info(answer),
        )

    def render(self) -> Picture | None:
        """The machine as its trial starts it, (320, 480, 3) uint8; white where there is none."""
        if self.render_mode is None:
            return None
        return picture_of(self.environment)

    def state(self) -> Snapshot:
        """Where the episode stands, as a value that no later step changes."""
        return self.environment.state()

    def restore(self, state: Snapshot | Mapping[str, Any]) -> None:
        """Goes to a state of this task; costs what differs from where the episode stands.

        Args:
            state: What `state` gave, here or in another environment, or its document.

        Raises:
            SnapshotError: It is another task's, or no state.
        """
        self.environment.restore(state)
        self._begun = True


def _info(answer: Answer) -> dict[str, Any]:
    info: dict[str, Any] = {"accepted": answer.accepted, "worth": answer.reward}
    if answer.trial is not None:
        info["score"] = score_told(answer.trial)
    return info
