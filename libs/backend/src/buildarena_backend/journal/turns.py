"""Results of journalled replies, turn by turn, while a session runs.

A turn is a reply in the journal, or an agent's call, and an event that says that it was taken, in
which order, and what its actions came to. So listeners hear of each turn once, and nothing that
the journal holds is written twice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import ARRAY, BindParameter, Row, RowMapping, Text, bindparam, text
from sqlalchemy.dialects.postgresql import JSONB

from buildarena_backend.database.database import Database
from buildarena_backend.database.tables import ANSWER_WORDS, FEEDBACK_WORDS, REPLY_WORDS
from buildarena_backend.database.text import clean
from buildarena_backend.leases.leases import Lease
from buildarena_backend.states import TURN, JobState


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnResult:
    """Result of one reply in a session.

    Attributes:
        index: Place in the transcript, from 0.
        sequence: Place of the reply in the journal.
        sub_structure: The part of the machine that it is about, if it is about one.
        results: Acceptance, refusal class and feedback of each tool call.
    """

    index: int
    sequence: int
    sub_structure: str | None
    results: Sequence[tuple[bool, str | None, str]]


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
    SELECT taken.turn, said.prompt_messages->>'system' AS system,
        said.prompt_messages->'user' AS user
    FROM journal AS said
    LEFT JOIN LATERAL (
        SELECT (data->>'index')::int AS turn FROM events
        WHERE events.job_id = said.job_id AND events.kind = '{TURN}'
            AND (events.data->>'sequence')::int = said.sequence LIMIT 1
    ) AS taken ON TRUE
    WHERE said.job_id = :job_id AND said.prompt_messages IS NOT NULL
    ORDER BY said.sequence
    """  # noqa: S608 - the kind is our own constant
)
LAST_ID = 2**63 - 1


class Turns:
    """Stores the results of replies, and reads both."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def append(self, lease: Lease, turn: TurnResult) -> None:
        """Write a reply's results; nothing when the lease is over, as another worker will."""
        data = {
            "index": turn.index,
            "sequence": turn.sequence,
            "sub_structure": turn.sub_structure,
            "results": [list(result) for result in turn.results],
        }
        parameters = {"job_id": lease.job.id, "token": lease.token, "data": clean(data)}
        self._database.run(_APPEND, parameters)

    def search(
        self,
        terms: str,
        *,
        tasks: Sequence[str] | None,
        models: Sequence[str] | None,
        sweep_ids: Sequence[str] | None,
        limit: int,
        offset: int = 0,
    ) -> Sequence[Row[Any]]:
        """Return the turns that contain words, in any form of English; the newest jobs' first.

        Rows have the job, its task, model, seed and outcome, the turn's place (None where only its
        reply is kept), ``where`` (``reply`` or ``feedback``), and an excerpt with each match
        between `BEGIN` and `END`.

        Args:
            terms: Search terms and operators: ``"a phrase"``, ``or``, ``-not``.
            tasks: Only of jobs on these; None for all, as of the others.
        """
        values = {
            "words": terms,
            "tasks": tasks,
            "models": models,
            "sweeps": sweep_ids,
            "most": MAX_MATCHES,
            "limit": limit,
            "offset": offset,
            "options": f"StartSel={BEGIN}, StopSel={END}, MinWords=15, MaxWords=35",
        }
        with self._database.transaction() as connection:
            # However many turns the words are expected in, the indexes find them.
            connection.execute(text("SET LOCAL enable_seqscan = off"))
            return connection.execute(SEARCH, values).all()

    def has_words(self, terms: str) -> bool:
        """Return whether a query has words to search for; "the" and "-wheel" have none."""
        query = text("SELECT querytree(websearch_to_tsquery('english', :words))")
        return self._database.first_value(query, {"words": terms}) not in {"", "T"}

    def prompts(self, job_id: str) -> Sequence[Row[Any]]:
        """Return the messages that a job's session sent to its roles, in order.

        Rows have the turn (None for a reply in none), the role's ``system`` message if it had none
        yet, and further messages as ``user``. Empty where no journal has it.
        """
        return self._database.all_rows(_PROMPTS, {"job_id": job_id})

    def count(self, job_id: str) -> int:
        """Return the number of a job's turns."""
        return int(self._database.first_value(_COUNT, {"job_id": job_id}))

    def read(self, job_id: str, *, after: int = 0, until: int = LAST_ID) -> Sequence[RowMapping]:
        """Return a model's turns in their order: the replies in the journal, and their results.

        Args:
            after: Only those whose events have greater ids.
            until: Only those whose events have this id or a smaller one.
        """
        parameters = {"job_id": job_id, "after": after, "until": until}
        with self._database.statement() as connection:
            return connection.execute(_READ, parameters).mappings().all()


MAX_MATCHES: Final = 5_000
"""Turns with the words that are looked at, of each kind; of more, only some are."""
BEGIN, END = "\x02", "\x03"
"""Marks around a match in an excerpt; transcripts have neither."""

TYPES: Final[Sequence[BindParameter[Any]]] = (
    bindparam("words", type_=Text()),
    *(bindparam(name, type_=ARRAY(Text)) for name in ("tasks", "models", "sweeps")),
)
WANTED: Final = """
    (CAST(:tasks AS text[]) IS NULL OR jobs.task = ANY(:tasks))
    AND (CAST(:models AS text[]) IS NULL OR jobs.model = ANY(:models))
    AND (CAST(:sweeps AS text[]) IS NULL OR EXISTS (
        SELECT FROM sweep_jobs WHERE sweep_id = ANY(:sweeps) AND job_id = jobs.id
    ))
"""
SEARCH: Final = text(
    f"""
    WITH asked AS MATERIALIZED (SELECT websearch_to_tsquery('english', :words) AS words),
    replies AS MATERIALIZED (
        SELECT job_id, sequence, NULL::bigint AS event
        FROM journal WHERE {REPLY_WORDS.text} @@ (SELECT words FROM asked) LIMIT :most
    ),
    feedback AS MATERIALIZED (
        SELECT job_id, NULL::int AS sequence, id AS event FROM events
        WHERE kind = '{TURN}' AND ({FEEDBACK_WORDS.text}) @@ (SELECT words FROM asked) LIMIT :most
    ),
    answers AS MATERIALIZED (
        SELECT job_id, sequence, NULL::bigint AS event
        FROM external_calls WHERE {ANSWER_WORDS.text} @@ (SELECT words FROM asked) LIMIT :most
    ),
    places AS (
        SELECT *, 'reply' AS kind FROM replies
        UNION ALL SELECT *, 'feedback' FROM feedback
        UNION ALL SELECT *, 'answer' FROM answers
    ),
    shown AS (
        SELECT places.*, jobs.task, jobs.model, jobs.seed, jobs.outcome, jobs.created_at
        FROM places JOIN jobs ON jobs.id = places.job_id
        WHERE {WANTED}
        ORDER BY jobs.created_at DESC, places.job_id, places.event, places.sequence
        LIMIT :limit OFFSET :offset
    )
    SELECT
        shown.job_id, shown.task, shown.model, shown.seed, shown.outcome,
        CASE WHEN shown.kind = 'reply' THEN 'reply' ELSE 'feedback' END AS "where",
        CASE shown.kind WHEN 'answer' THEN shown.sequence
            ELSE (coalesce(answered.data, taken.data) ->> 'index')::int END AS turn,
        ts_headline('english', left(CASE shown.kind
            WHEN 'reply' THEN said.reply ->> 'text'
            WHEN 'answer' THEN calls.feedback
            ELSE (
                SELECT string_agg(answer #>> '{{}}', E'\\n')
                FROM jsonb_path_query(answered.data, '$.results[*][2]') AS answer
            )
        END, 100000), (SELECT words FROM asked), :options) AS excerpt
    FROM shown
    LEFT JOIN journal AS said
        ON shown.kind = 'reply' AND said.job_id = shown.job_id AND said.sequence = shown.sequence
    LEFT JOIN external_calls AS calls
        ON shown.kind = 'answer' AND calls.job_id = shown.job_id AND calls.sequence = shown.sequence
    LEFT JOIN events AS answered ON answered.id = shown.event
    LEFT JOIN LATERAL (
        SELECT data FROM events
        WHERE shown.kind = 'reply' AND events.job_id = shown.job_id AND events.kind = '{TURN}'
            AND (events.data ->> 'sequence')::int = shown.sequence LIMIT 1
    ) AS taken ON TRUE
    ORDER BY shown.created_at DESC, shown.job_id, turn NULLS LAST, "where" DESC
    """  # noqa: S608 - constants only
).bindparams(*TYPES)
