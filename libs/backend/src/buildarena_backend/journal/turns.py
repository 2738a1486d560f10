"""What came of the journalled replies, turn by turn, while a session is under way.

A turn is a reply in the journal, or an agent's call, and an event that says that it was taken, in
which order, and what its actions came to. So listeners hear of each turn once, and nothing that
the journal holds is written twice.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

from sqlalchemy import bindparam, text
from sqlalchemy.dialects.postgresql import JSONB

from buildarena_backend.database.database import Database
from buildarena_backend.database.text import clean
from buildarena_backend.journal.transcript_search import (
    TranscriptFilter,
    TranscriptMatch,
    has_words,
    search_transcripts,
)
from buildarena_backend.leases.leases import Lease
from buildarena_backend.states import TURN, JobState


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnResult:
    """What a session made of one reply.

    Attributes:
        index: Place in the transcript, from 0.
        sequence: Place of the reply in the journal.
        sub_structure: The part of the machine that it is about, if it is about one.
        results: Of each tool call whether it was accepted, its refusal class and its feedback.
    """

    index: int
    sequence: int
    sub_structure: str | None
    results: Sequence[tuple[bool, str | None, str]]


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnRecord:
    """A model's turn: its reply in the journal, and what came of it; see `JournalEntry`."""

    index: int
    sub_structure: str | None
    results: Sequence[Sequence[Any]]
    stage: str
    role: str
    reply: Mapping[str, Any]
    input_tokens: int
    output_tokens: int
    cost_usd: Decimal
    latency_s: float
    tries: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Prompt:
    """What a session told a role before one of its replies.

    Attributes:
        turn: Place of the reply in the transcript; None where it is in none.
        system: The role's system message, if it had none yet.
        user: Further messages: the task, what is to be done, results of trials.
    """

    turn: int | None
    system: str | None
    user: Sequence[str]


# The lock makes a worker that lost its lease write before the next one counts, or not at all.
_APPEND = text(
    f"""
    WITH job AS (
        SELECT id FROM jobs
        WHERE id = :job_id AND lease_token = :token AND state = '{JobState.RUNNING}' FOR SHARE
    )
    INSERT INTO events (job_id, kind, data) SELECT id, '{TURN}', :data FROM job
    """  # noqa: S608 - the state and the kind are our own constants
).bindparams(bindparam("data", type_=JSONB))
_COUNT = text(
    f"SELECT count(*) FROM events WHERE job_id = :job_id AND kind = '{TURN}'"  # noqa: S608 - ours
)
_READ = text(
    f"""
    SELECT
        (taken.data->>'index')::int AS index, taken.data->>'sub_structure' AS sub_structure,
        taken.data->'results' AS results, said.stage, said.role, said.reply, said.input_tokens,
        said.output_tokens, said.cost_usd, said.latency_s, said.tries
    FROM events AS taken
    JOIN journal AS said
        ON said.job_id = taken.job_id AND said.sequence = (taken.data->>'sequence')::int
    WHERE taken.job_id = :job_id AND taken.kind = '{TURN}'
        AND taken.id > :after AND taken.id <= :until
    ORDER BY taken.id
    """  # noqa: S608 - the kind is our own constant
)
_PROMPTS = text(
    f"""
    SELECT taken.turn, said.told->>'system' AS system, said.told->'user' AS user
    FROM journal AS said
    LEFT JOIN LATERAL (
        SELECT (data->>'index')::int AS turn FROM events
        WHERE events.job_id = said.job_id AND events.kind = '{TURN}'
            AND (events.data->>'sequence')::int = said.sequence LIMIT 1
    ) AS taken ON TRUE
    WHERE said.job_id = :job_id AND said.told IS NOT NULL
    ORDER BY said.sequence
    """  # noqa: S608 - the kind is our own constant
)
LAST_ID = 2**63 - 1


class Turns:
    """Keeps what came of replies, and reads it with them."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def append(self, lease: Lease, turn: TurnResult) -> None:
        """Writes what came of a reply; nothing when the lease is over, as another worker will."""
        data = {
            "index": turn.index,
            "sequence": turn.sequence,
            "sub_structure": turn.sub_structure,
            "results": [list(result) for result in turn.results],
        }
        given = {"job_id": lease.job.id, "token": lease.token, "data": clean(data)}
        with self._database.statement() as connection:
            connection.execute(_APPEND, given)

    def search(
        self, words: str, wanted: TranscriptFilter, *, limit: int, offset: int = 0
    ) -> list[TranscriptMatch]:
        """The turns of all jobs in which words stand, see `search_transcripts`."""
        with self._database.transaction() as connection:
            return search_transcripts(connection, words, wanted, limit=limit, offset=offset)

    def has_words(self, words: str) -> bool:
        """Whether there is anything to search for."""
        with self._database.statement() as connection:
            return has_words(connection, words)

    def prompts(self, job_id: str) -> list[Prompt]:
        """What a job's session told its roles, in order; empty where no journal has it."""
        with self._database.statement() as connection:
            rows = connection.execute(_PROMPTS, {"job_id": job_id}).mappings()
            return [Prompt(**row) for row in rows]

    def count(self, job_id: str) -> int:
        """How many turns of a job are there."""
        with self._database.statement() as connection:
            return int(connection.execute(_COUNT, {"job_id": job_id}).scalar_one())

    def read(self, job_id: str, *, after: int = 0, until: int = LAST_ID) -> list[TurnRecord]:
        """A model's turns in their order.

        Args:
            job_id: The job.
            after: Only those whose events have greater ids.
            until: Only those whose events have this id or a smaller one.
        """
        given = {"job_id": job_id, "after": after, "until": until}
        with self._database.statement() as connection:
            return [TurnRecord(**row) for row in connection.execute(_READ, given).mappings()]
