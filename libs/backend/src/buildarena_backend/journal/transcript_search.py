"""Searches through the transcripts of all jobs, by the words of what was said and answered."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

from sqlalchemy import ARRAY, BindParameter, Connection, Text, bindparam, text

from buildarena_backend.database.tables import ANSWER_WORDS, FEEDBACK_WORDS, REPLY_WORDS
from buildarena_backend.states import TURN

MAX_MATCHES: Final = 5_000
"""Turns with the words that are looked at, of each kind; of more, only some are."""
BEGIN, END = "\x02", "\x03"
"""What stands around a match in an excerpt; transcripts have neither."""

Where = Literal["reply", "feedback"]


@dataclass(frozen=True, slots=True, kw_only=True)
class TranscriptFilter:
    """Which transcripts are searched; None means any.

    Attributes:
        tasks: Of jobs on these tasks.
        models: Of these models' jobs.
        sweep_ids: Of these sweeps' jobs.
    """

    tasks: Sequence[str] | None = None
    models: Sequence[str] | None = None
    sweep_ids: Sequence[str] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class TranscriptMatch:
    """A turn in which the words stand.

    Attributes:
        job_id: Its job.
        task: What was built.
        model: Who built.
        seed: Which try it was.
        outcome: How the job ended; None while it has not.
        turn: The turn's place in the transcript; None where only its reply is kept.
        where: In what the model said, or in what it was answered.
        excerpt: The text around the words: pieces, and whether each is one of them.
    """

    job_id: str
    task: str
    model: str
    seed: int
    outcome: str | None
    turn: int | None
    where: Where
    excerpt: Sequence[tuple[str, bool]]


def has_words(connection: Connection, words: str) -> bool:
    """Whether there is anything to search for: "the" is nothing, and "-wheel" is nearly all."""
    query = text("SELECT querytree(websearch_to_tsquery('english', :words))")
    return connection.execute(query, {"words": words}).scalar_one() not in {"", "T"}


def search_transcripts(
    connection: Connection, words: str, wanted: TranscriptFilter, *, limit: int, offset: int = 0
) -> list[TranscriptMatch]:
    """The turns in which words stand, in any form of English; those of the newest jobs first.

    Args:
        connection: A transaction of its own.
        words: As search engines take them: ``"a phrase"``, ``or``, ``-not``.
        wanted: Whose transcripts.
        limit: Turns at most.
        offset: How many of the first are left out.
    """
    # However many turns the words are expected in, the indexes find them.
    connection.execute(text("SET LOCAL enable_seqscan = off"))
    values = {
        "words": words,
        "tasks": wanted.tasks,
        "models": wanted.models,
        "sweeps": wanted.sweep_ids,
        "most": MAX_MATCHES,
        "limit": limit,
        "offset": offset,
        "options": f"StartSel={BEGIN}, StopSel={END}, MinWords=15, MaxWords=35",
    }
    rows = connection.execute(SEARCH, values).all()
    return [
        TranscriptMatch(
            **{name: getattr(row, name) for name in ("job_id", *FOUND)},
            where=row.place,
            excerpt=_pieces(row.excerpt),
        )
        for row in rows
    ]


def _pieces(excerpt: str) -> list[tuple[str, bool]]:
    """An excerpt cut where its matches begin and end."""
    pieces = re.split(f"([{BEGIN}{END}])", excerpt)
    found: list[tuple[str, bool]] = []
    inside = False
    for piece in pieces:
        if piece in {BEGIN, END}:
            inside = piece == BEGIN
        elif piece:
            found.append((piece, inside))
    return found


FOUND: Final = ("task", "model", "seed", "outcome", "turn")
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
        CASE WHEN shown.kind = 'reply' THEN 'reply' ELSE 'feedback' END AS place,
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
    ORDER BY shown.created_at DESC, shown.job_id, turn NULLS LAST, place DESC
    """  # noqa: S608 - made of our own constants
).bindparams(*TYPES)
