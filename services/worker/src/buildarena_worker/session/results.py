"""Results of sessions."""

from collections.abc import Sequence
from dataclasses import dataclass

from buildarena_backend.accounts.budgets import BudgetShortage
from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_geometry import KeyPress, Machine


@dataclass(frozen=True, slots=True, kw_only=True)
class Suspended:
    """The session waits for a simulation.

    Attributes:
        machine: Machine to simulate.
        controls: Key presses, or None for the task's own.
        final: True when the job ends with this rollout's score.
        number: Index among the job's rollouts, from 0.
    """

    machine: Machine
    controls: Sequence[KeyPress] | None
    final: bool
    number: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Finished:
    """The session ended.

    Attributes:
        best: The rollout that counts.
    """

    best: RolloutRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class Failed:
    """The model built no machine that may be simulated, or a limit is reached: a scored failure.

    Attributes:
        reason: Class of the failure, for example ``objection`` or ``turn_limit``; the name of the
            job's limit on requests, tokens, money or time that the session has used up.
        detail: A sentence for people.
    """

    reason: str
    detail: str


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetExhausted:
    """A budget can't pay for the next request: the job waits until there is more.

    Attributes:
        shortage: The budget that is used up, and the missing amount.
    """

    shortage: BudgetShortage


@dataclass(frozen=True, slots=True)
class Drained:
    """The worker stops before the next request: another worker resumes the session."""


SessionResult = Suspended | Finished | Failed | BudgetExhausted | Drained


class SessionEnded(Exception):  # noqa: N818 - the way out of a workflow, not an error
    """Carrier of a result out of a workflow, caught in `workflow.rounds` only.

    A workflow is plain code that calls the session's host, which finds that it can't continue.

    Attributes:
        result: Result of the session, or of one of its rounds.
    """

    def __init__(self, result: SessionResult) -> None:
        super().__init__(str(result))
        self.result = result


class ConstructionFailedError(SessionEnded):
    """The model gave up or broke the rules.

    Args:
        reason: Class of the failure, for example ``turn_limit``.
        detail: A sentence for people.
    """

    result: Failed

    def __init__(self, reason: str, detail: str) -> None:
        super().__init__(Failed(reason=reason, detail=detail))
