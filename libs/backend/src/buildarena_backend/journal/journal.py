"""The journal: every model reply, written before it is used, so that none is paid for twice."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from decimal import Decimal
from typing import Any, Final

from sqlalchemy import bindparam, func, select, text

from buildarena_backend.database.account_tables import MAX_USD
from buildarena_backend.database.database import Database
from buildarena_backend.database.tables import journal
from buildarena_backend.errors import StaleLeaseError
from buildarena_backend.leases.leases import Lease
from buildarena_backend.states import BUILTIN_PROVIDER, JobState


@dataclass(frozen=True, slots=True, kw_only=True)
class Usage:
    """Use of one or more model requests.

    Attributes:
        requests: Model requests that were answered.
        input_tokens: Tokens sent, those read from a cache included.
        output_tokens: Tokens received, reasoning included.
        cached_tokens: The part of the input that the provider read from its cache.
        reasoning_tokens: The part of the output that was hidden reasoning.
        cost_usd: Price in US dollars.
    """

    requests: int = 0
    input_tokens: int = 0
    output_tokens: int = 0
    cached_tokens: int = 0
    reasoning_tokens: int = 0
    cost_usd: Decimal = field(default_factory=Decimal)

    def __add__(self, other: Usage) -> Usage:
        summed = {name: getattr(self, name) + getattr(other, name) for name in _USED}
        return Usage(**summed)


_USED = tuple(Usage.__dataclass_fields__)
GARBAGE = "garbage"
"""Finish word of an answer that can't be read."""
OUT_OF_TIME = "out_of_time"
"""Finish word of a request that was broken off because the job's time was over."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JournalEntry:
    """A model request and its reply.

    Attributes:
        sequence: Place in the session, from 0.
        stage: Session stage, for example ``build``.
        role: Role that sent the request, for example ``guidance``.
        request_hash: Content hash of the request.
        reply: The reply in our own neutral form.
        latency_s: Seconds from sending to having the reply, waits for retries included.
        tries: Number of attempts; 1 if the first was answered.
        provider_request_id: The provider's id of the request, if any.
        system_fingerprint: The provider's name of its configuration, if any.
        failures: Reasons why earlier requests failed, one text each.
        prompt_messages: Messages sent to the role since its last reply: ``system``, its system
            message if it had none yet, and ``user``, texts. Other roles' messages are not in it.
    """

    sequence: int
    stage: str
    role: str
    request_hash: str
    reply: Mapping[str, Any]
    usage: Usage
    latency_s: float
    tries: int = 1
    provider_request_id: str | None = None
    system_fingerprint: str | None = None
    failures: Sequence[str] = ()
    created_at: datetime | None = None
    prompt_messages: Mapping[str, Any] | None = None

    @property
    def answers(self) -> bool:
        """True if a session continues with its reply; otherwise it only counts and was paid for."""
        return self.reply.get("finish") not in {GARBAGE, OUT_OF_TIME}


_PAYERS: Final = ", ".join(
    f"CASE WHEN model_config->>'provider' IS DISTINCT FROM '{BUILTIN_PROVIDER}' THEN {name} END"
    f" AS {name}"
    for name in ("payer", "owner")
)
"""Sweep and key that pay for a request; none for free ones."""
# One statement, because it is the one that every turn of every session waits for.
_APPEND = text(
    f"""
    WITH job AS (
        UPDATE jobs SET
            requests = requests + :requests,
            input_tokens = input_tokens + :input_tokens,
            output_tokens = output_tokens + :output_tokens,
            cached_tokens = cached_tokens + :cached_tokens,
            reasoning_tokens = reasoning_tokens + :reasoning_tokens,
            cost_usd = LEAST(cost_usd + :cost_usd, {MAX_USD}),
            faults = CASE WHEN :answers THEN 0 ELSE faults END
        WHERE id = :job_id AND lease_token = :token AND state = '{JobState.RUNNING}'
        RETURNING id, {_PAYERS}
    ), settled AS (
        DELETE FROM reservations USING job WHERE reservations.job_id = job.id
    ), paying AS (
        SELECT budgets.id FROM budgets JOIN job ON budgets.id IN (job.payer, job.owner)
        ORDER BY budgets.id FOR UPDATE OF budgets
    ), charged AS (
        UPDATE budgets SET
            spent_cost_usd = LEAST(spent_cost_usd + :cost_usd, {MAX_USD}),
            spent_tokens = spent_tokens + :input_tokens + :output_tokens,
            spent_requests = spent_requests + :requests
        FROM paying WHERE budgets.id = paying.id
    )
    INSERT INTO journal (
        job_id, sequence, token, stage, role, request_hash, reply, input_tokens, output_tokens,
        cached_tokens, reasoning_tokens, cost_usd, latency_s, tries, provider_request_id,
        system_fingerprint, failures, payer, owner, prompt_messages
    )
    SELECT
        id, :sequence, :token, :stage, :role, :request_hash, CAST(:reply AS json), :input_tokens,
        :output_tokens, :cached_tokens, :reasoning_tokens, :cost_usd, :latency_s, :tries,
        CAST(:provider_request_id AS text), CAST(:system_fingerprint AS text),
        CAST(:failures AS jsonb), payer, owner, CAST(:prompt_messages AS json)
    FROM job
    """  # noqa: S608 - the state is our own constant
)


_OF_JOB = (
    select(journal).where(journal.c.job_id == bindparam("job_id")).order_by(journal.c.sequence)
)

_KEPT = (
    *("sequence", "stage", "role", "request_hash", "latency_s", "tries"),
    *("provider_request_id", "system_fingerprint"),
)
"""Fields of an entry that are columns as they are."""


class Journal:
    """Appends to and reads the journals of jobs."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def append(self, lease: Lease, entry: JournalEntry) -> None:
        """Write a reply and charge its usage to the job and its budgets, all or nothing.

        A job that makes progress is not given up for its earlier faults; only a usable reply is
        progress.

        Raises:
            StaleLeaseError: The lease is over; nothing was written.
        """
        prompts = entry.prompt_messages
        parameters = {
            "job_id": lease.job.id,
            "token": lease.token,
            "answers": entry.answers,
            **{name: getattr(entry, name) for name in _KEPT},
            **{name: getattr(entry.usage, name) for name in _USED},
            "reply": json.dumps(entry.reply),
            "failures": json.dumps(entry.failures) if entry.failures else None,
            "prompt_messages": None if prompts is None else json.dumps(prompts),
        }
        if self._database.run(_APPEND, parameters) != 1:
            raise StaleLeaseError(lease.job.id, lease.token)

    def retries(self, job_id: str) -> dict[str, int]:
        """Return the number of repeated requests, by cause."""
        failure = func.jsonb_array_elements_text(journal.c.failures).label("failure")
        failed = select(failure).where(journal.c.job_id == job_id).subquery()
        times = func.count().label("times")
        query = select(failed.c.failure, times).group_by(failed.c.failure)
        return {row.failure: row.times for row in self._database.all_rows(query)}

    def read(self, job_id: str) -> list[JournalEntry]:
        """Return all entries of a job in their order."""
        return [
            JournalEntry(
                **{name: getattr(row, name) for name in _KEPT},
                usage=Usage(requests=1, **{name: getattr(row, name) for name in _USED[1:]}),
                reply=row.reply,
                failures=row.failures or (),
                created_at=row.created_at,
                prompt_messages=row.prompt_messages,
            )
            for row in self._database.all_rows(_OF_JOB, {"job_id": job_id})
        ]
