"""Bounds of an episode, and the results of resets, steps and submissions."""

from dataclasses import dataclass
from typing import Final

from buildarena_benchmark.environment.trials.trials import Trial
from buildarena_geometry import Outcome, ToolDefinition

DEFAULT_STEPS: Final = 2000
"""Steps that an episode may have unless it is given another limit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Bounds on an episode's length.

    Attributes:
        steps: Most steps, refused ones included.
        parts: Parts that all its machines may have together; None for any number. Public servers
            need a limit: copies of copies grow fast.
    """

    steps: int = DEFAULT_STEPS
    parts: int | None = None

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise ValueError(f"steps is {self.steps}: an episode has at least one")
        if self.parts is not None and self.parts < 1:
            raise ValueError(f"parts is {self.parts}: a machine has at least one")


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """First observation of a builder.

    Attributes:
        briefing: Markdown with statement, rules and modules.
    """

    task: str
    briefing: str
    tools: tuple[ToolDefinition, ...]


@dataclass(slots=True)
class Step:
    """Result of a step.

    Attributes:
        outcome: Whether the action was accepted, and why not.
        truncated: Whether it was the last step of the episode: only `submit` remains.
    """

    outcome: Outcome
    reward: float
    truncated: bool

    @property
    def ok(self) -> bool:
        """True if the action was accepted."""
        return self.outcome.ok

    @property
    def feedback(self) -> str:
        """Text about it for a model, written when it is read."""
        return self.outcome.text


@dataclass(frozen=True, slots=True, kw_only=True)
class Submission:
    """Result of a submission."""

    trial: Trial
    reward: float
    report: str
    done: bool
