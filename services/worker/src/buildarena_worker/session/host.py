"""What a session asks of the outside world: model replies and simulations.

A session is a deterministic function of its task, seed, settings and the answers that came
through here. Both kinds of answers are kept, so a session that died is taken up by running it
again: it gets the kept answers first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, Protocol

from buildarena_geometry import KeyPress, Machine
from buildarena_pipeline.runtime.tracing import span
from buildarena_simulation import Trajectory
from buildarena_store import JournalEntry, RolloutRecord, Usage, clean
from buildarena_worker.errors import JournalMismatchError, LeaseLostError, LimitReachedError
from buildarena_worker.session.messages import Reply, Request


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """A reply with what it took to get it."""

    reply: Reply
    usage: Usage
    latency_s: float
    tries: int = 1
    provider_request_id: str | None = None


class ModelClient(Protocol):
    """Something that answers requests: a provider, a built-in model, a stand-in."""

    def complete(self, request: Request) -> Answer:
        """Asks the model.

        Raises:
            TransientError: The provider failed, after the declared retries.
            PermanentError: The provider will never answer, for example a bad key.
        """


class SuspendedError(Exception):
    """The session waits for a simulation; it goes on when that is done.

    Attributes:
        machine: What is to be simulated.
        controls: The key presses, or None for the task's own.
        final: True when the job ends with this rollout's score.
        number: Place among the job's rollouts.
    """

    def __init__(
        self, machine: Machine, controls: Sequence[KeyPress] | None, *, final: bool, number: int
    ) -> None:
        super().__init__(f"waits for rollout {number}")
        self.machine = machine
        self.controls = controls
        self.final = final
        self.number = number


@dataclass(slots=True, kw_only=True)
class Spent:
    """What a session used so far, replayed answers included."""

    usage: Usage
    seconds: float = 0.0

    def check(self, limits: Mapping[str, Any]) -> None:
        """Compares with the job's limits.

        Raises:
            LimitReachedError: One is reached.
        """
        usage = self.usage
        tokens = usage.input_tokens + usage.output_tokens
        spent: dict[str, float | Decimal] = {
            "max_requests": usage.requests,
            "max_tokens": tokens,
            "max_cost_usd": usage.cost_usd,
            "max_seconds": self.seconds,
        }
        for name, value in spent.items():
            limit = limits.get(name)
            if limit is not None and float(value) >= float(limit):
                raise LimitReachedError(name, f"{name} is {limit}, the session used {value}")


class SessionIO:
    """Gives kept answers first, then new ones, and keeps those.

    Args:
        client: Answers new requests; None when only kept answers may be used.
        entries: The journal so far.
        rollouts: The finished rollouts so far.
        append: Writes a new journal entry, before its reply is used.
        still_held: Tells whether the lease goes on.
        limits: The job's limits.
        load_trajectory: Reads a kept trajectory by its hash.
        reserve: Puts aside what a new request may cost, before it is sent.
        waiting: What surrounds the wait for a new reply.
    """

    def __init__(
        self,
        *,
        client: ModelClient | None,
        entries: Sequence[JournalEntry],
        rollouts: Sequence[RolloutRecord],
        append: Callable[[JournalEntry], None],
        still_held: Callable[[], bool],
        limits: Mapping[str, Any],
        load_trajectory: Callable[[str], Trajectory],
        reserve: Callable[[Request], None] = lambda _: None,
        waiting: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        self._waiting = waiting
        self._reserve = reserve
        self._load_trajectory = load_trajectory
        self._client = client
        self._entries = entries
        self._rollouts = [record for record in rollouts if record.finished_at is not None]
        self._append = append
        self._still_held = still_held
        self._limits = limits
        self._next_rollout = 0
        self.sequence = 0
        self.spent = Spent(usage=Usage())

    @property
    def replaying(self) -> bool:
        """Whether the next answer is a kept one."""
        return self.sequence < len(self._entries)

    def ask(self, request: Request, *, stage: str, role: str) -> JournalEntry:
        """The model's answer to a request, with what it cost.

        Raises:
            LimitReachedError: The session may ask no more.
            LeaseLostError: Another worker has the job.
            JournalMismatchError: The kept answer belongs to another request.
        """
        self.spent.check(self._limits)
        entry = self._kept(request) if self.replaying else self._new(request, stage, role)
        self.sequence += 1
        self.spent.usage += entry.usage
        self.spent.seconds += entry.latency_s
        return entry

    def _kept(self, request: Request) -> JournalEntry:
        entry = self._entries[self.sequence]
        if entry.request_hash != request.hash:
            raise JournalMismatchError(
                f"entry {self.sequence} ({entry.stage}, {entry.role}) was asked otherwise: "
                "the session's code or prompts have changed since"
            )
        return entry

    def _new(self, request: Request, stage: str, role: str) -> JournalEntry:
        if self._client is None:
            raise JournalMismatchError(f"the journal ends at entry {self.sequence}")
        if not self._still_held():
            raise LeaseLostError("the lease is over")
        with (
            span("model request", stage=stage, role=role, sequence=self.sequence),
            self._waiting(),
        ):
            self._reserve(request)
            answer = self._client.complete(request)
        entry = JournalEntry(
            sequence=self.sequence,
            stage=stage,
            role=role,
            request_hash=request.hash,
            reply=clean(answer.reply.to_json()),
            usage=answer.usage,
            latency_s=answer.latency_s,
            tries=answer.tries,
            provider_request_id=answer.provider_request_id,
        )
        self._append(entry)
        return entry

    def simulate(
        self, machine: Machine, controls: Sequence[KeyPress] | None, *, final: bool
    ) -> RolloutRecord:
        """The result of simulating the machine.

        Raises:
            SuspendedError: It is not there yet; the session is to be run again when it is.
        """
        number = self._next_rollout
        if number >= len(self._rollouts):
            raise SuspendedError(machine, controls, final=final, number=number)
        self._next_rollout += 1
        return self._rollouts[number]

    def trajectory(self, record: RolloutRecord) -> Trajectory | None:
        """The trajectory of a rollout; None when its machine could not be simulated."""
        if record.trajectory_hash is None:
            return None
        return self._load_trajectory(record.trajectory_hash)
