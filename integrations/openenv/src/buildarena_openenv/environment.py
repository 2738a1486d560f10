"""One session's episodes on the server."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any, Final

from openenv.core.env_server.interfaces import Environment as ServedEnvironment
from openenv.core.env_server.types import EnvironmentMetadata

from buildarena_environment import DEFAULT_STEPS, Answer, Environment, Limits, TrialPool, call
from buildarena_openenv.models import BuildAction, BuildObservation, BuildState
from buildarena_simulation import DEFAULT_ENGINE

SETTINGS: Final = ("task", "rounds", "steps")
MAX_EPISODE_ID: Final = 255
MAX_ROUNDS: Final = 10
MAX_PARTS: Final = 5_000
"""Parts that all machines of a session may have together; the largest task allows 500."""
MAX_SEED: Final = 2**31
DEFAULT_TASK: Final = "support-1"


@dataclass(frozen=True, slots=True, kw_only=True)
class Terms:
    """What a server offers and what it bounds.

    Attributes:
        task: The task of an episode whose client names none.
        simulator: Name of the engine that tries machines.
        max_steps: Calls that an episode may have, and has unless its client asks for fewer.
        rewards: Weights by the names of `buildarena_environment.rewards`; None for success alone.
    """

    task: str = DEFAULT_TASK
    simulator: str = DEFAULT_ENGINE
    max_steps: int = DEFAULT_STEPS
    rewards: Mapping[str, float] | None = None


class BuildEnvironment(ServedEnvironment[BuildAction, BuildObservation, BuildState]):
    """The episodes of one session; sessions share the processes that try machines.

    Args:
        terms: What the server offers.
        pool: What tries machines.

    Raises:
        UnknownChoiceError: Task, simulator or a reward does not exist.
    """

    SUPPORTS_CONCURRENT_SESSIONS = True

    def __init__(self, terms: Terms, pool: TrialPool) -> None:
        super().__init__()
        self._terms, self._pool = terms, pool
        self._episode_id: str | None = None
        self._environment = self._made(None, {})

    def reset(
        self, seed: int | None = None, episode_id: str | None = None, **settings: Any
    ) -> BuildObservation:
        """Begins an episode.

        Args:
            seed: Starts machine and cargo a little elsewhere; None for the exact start.
            episode_id: What the client calls it.
            settings: `task`, `rounds`, `steps`.

        Raises:
            ValueError: There is no such setting, or it is out of range.
        """
        for name in settings:
            if name not in SETTINGS:
                raise ValueError(
                    f"there is no setting {name[:40]!r}: choose from seed, episode_id, "
                    f"{', '.join(SETTINGS)}"
                )
        if seed is not None:
            seed = _whole("seed", seed, least=0, most=MAX_SEED)
        if episode_id is not None and (
            not isinstance(episode_id, str) or len(episode_id) > MAX_EPISODE_ID
        ):
            raise ValueError(f"episode_id is a text of at most {MAX_EPISODE_ID} characters")
        self._environment = self._made(seed, settings)
        self._episode_id = episode_id
        seen = self._environment.observation
        tools = [tool.as_document() for tool in seen.tools]
        return BuildObservation(text=seen.briefing, tools=tools, reward=0.0)

    def step(
        self,
        action: BuildAction,
        timeout_s: float | None = None,  # noqa: ARG002 - the framework's signature
        **_: Any,
    ) -> BuildObservation:
        """Carries out a call.

        Args:
            action: The call.
            timeout_s: Has no effect: the server bounds trials.

        Raises:
            EpisodeOverError: The episode has ended.
            SimulationError: The simulator failed; the call may be made again.
        """
        return _observed(call(self._environment, action.tool, action.arguments))

    @property
    def state(self) -> BuildState:
        """Where the episode stands."""
        environment = self._environment
        snapshot = environment.state()
        return BuildState(
            episode_id=self._episode_id,
            step_count=snapshot.steps,
            task=snapshot.task,
            simulator=environment.simulator,
            start_seed=environment.seed,
            worth=environment.reward,
            steps_left=environment.steps_left,
            done=environment.done,
            machines={name: machine.part_count for name, machine in environment.machines.items()},
        )

    def get_metadata(self) -> EnvironmentMetadata:
        """What the environment is."""
        return EnvironmentMetadata(
            name="buildarena",
            description="Machines that are built by tool calls and simulated",
            version=version("buildarena-openenv"),
        )

    def _made(self, seed: int | None, settings: Mapping[str, Any]) -> Environment:
        terms = self._terms
        task = settings.get("task", terms.task)
        if not isinstance(task, str):
            raise ValueError(f"task is a name, not {type(task).__name__}")  # noqa: TRY004 - a value that was sent
        steps = settings.get("steps", terms.max_steps)
        return Environment(
            task[:100],
            terms.simulator,
            seed=seed,
            rounds=_whole("rounds", settings.get("rounds", 1), least=1, most=MAX_ROUNDS),
            limits=Limits(
                steps=_whole("steps", steps, least=1, most=terms.max_steps), parts=MAX_PARTS
            ),
            rewards=terms.rewards,
            tries=self._pool.try_machine,
        )


def _observed(answer: Answer) -> BuildObservation:
    score = None
    if answer.trial is not None:
        score = answer.trial.as_document()
        del score["wall_s"]
    return BuildObservation(
        text=answer.text,
        accepted=answer.accepted,
        truncated=answer.truncated,
        score=score,
        reward=answer.gained,
        done=answer.terminated or answer.truncated,
    )


def _whole(name: str, value: object, *, least: int, most: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise ValueError(f"{name} is a whole number from {least} to {most:,}")
    return value
