"""Searches through the transcripts of all jobs, by the words of what was said and answered."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

from sqlalchemy import Connection, Text, bindparam, text

from buildarena_backend.database.tables import ANSWER_WORDS, FEEDBACK_WORDS, REPLY_WORDS, TOLD_WORDS
from buildarena_backend.states import TURN

MAX_MATCHES: Final = 5_000
"""Turns with the words that are looked at, of each kind; of more, only some are."""
BEGIN, END = "\x02", "\x03"
"""What stands around a match in an excerpt; transcripts have neither."""

Where = Literal["reply", "feedback", "prompt"]


@dataclass(frozen=True, slots=True, kw_only=True)
class TranscriptFilter:
    """Which transcripts are searched; None means any.

    Attributes:
        task: Of jobs on this task.
        model: Of this model's jobs.
        sweep_id: Of this sweep's jobs.
        prompts: Whether what roles were told is searched, in place of what was said and answered.
    """

    task: str | None = None
    model: str | None = None
    sweep_id: str | None = None
    prompts: bool = False


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
        where: In what the model said, in what it was answered, or in what it was told before.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class TranscriptMatches:
    """What a search came to.

    Attributes:
        matches: The turns, those of the newest jobs first.
        complete: Whether all turns with the words were looked at and are here.
    """

    matches: Sequence[TranscriptMatch]
    complete: bool


def has_words(connection: Connection, words: str) -> bool:
    """Whether there is anything to search for: "the" is nothing, and "-wheel" is nearly all."""
    query = text("SELECT querytree(websearch_to_tsquery('english', :words))")
    return connection.execute(query, {"words": words}).scalar_one() not in {"", "T"}


def search_transcripts(
    connection: Connection, words: str, wanted: TranscriptFilter, *, limit: int
) -> TranscriptMatches:
    """The turns in which words stand, in any form that English has of them.

    Histories that were packed are not searched. Of prompts, which repeat themselves, it is the
    first turn of each job.

    Args:
        connection: A transaction of its own.
        words: As search engines take them: ``"a phrase"``, ``or``, ``-not``.
        wanted: Whose transcripts.
        limit: Turns at most.
    """
    # However many turns the words are expected in, the indexes find them.
    connection.execute(text("SET LOCAL enable_seqscan = off"))
    values = {
        "words": words,
        "task": wanted.task,
        "model": wanted.model,
        "sweep": wanted.sweep_id,
        "most": MAX_MATCHES + 1,
        "limit": limit + 1,
        "options": f"StartSel={BEGIN}, StopSel={END}, MinWords=15, MaxWords=35",
    }
    rows = connection.execute(SEARCH_PROMPTS if wanted.prompts else SEARCH, values).all()
    return TranscriptMatches(
        matches=[
            TranscriptMatch(
                **{name: getattr(row, name) for name in ("job_id", *FOUND)},
                where=row.place,
                excerpt=_pieces(row.excerpt),
            )
            for row in rows[:limit]
        ],
        complete=len(rows) <= limit and not any(row.crowded for row in rows),
    )


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
TEXTS: Final = ("words", "task", "model", "sweep")
WANTED: Final = """
    (CAST(:task AS text) IS NULL OR jobs.task = :task)
    AND (CAST(:model AS text) IS NULL OR jobs.model = :model)
    AND (CAST(:sweep AS text) IS NULL OR EXISTS (
        SELECT FROM sweep_jobs WHERE sweep_id = :sweep AND job_id = jobs.id
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
        ORDER BY jobs.created_at DESC, places.job_id, places.event, places.sequence LIMIT :limit
    )
    SELECT
        shown.job_id, shown.task, shown.model, shown.seed, shown.outcome,
        CASE WHEN shown.kind = 'reply' THEN 'reply' ELSE 'feedback' END AS place,
        CASE shown.kind WHEN 'answer' THEN shown.sequence
            ELSE (coalesce(answered.data, taken.data) ->> 'index')::int END AS turn,
        (
            SELECT greatest(
                (SELECT count(*) FROM replies), (SELECT count(*) FROM feedback),
                (SELECT count(*) FROM answers)
            ) >= :most
        ) AS crowded,
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
).bindparams(*(bindparam(name, type_=Text()) for name in TEXTS))
# Jobs of one task are told the same, so which jobs are wanted is asked before any are left out;
# with OFFSET 0 the words are looked up first, by their index.
SEARCH_PROMPTS: Final = text(
    f"""
    WITH asked AS MATERIALIZED (SELECT websearch_to_tsquery('english', :words) AS words),
    told AS MATERIALIZED (
        SELECT found.job_id, found.sequence FROM (
            SELECT job_id, sequence FROM journal
            WHERE told IS NOT NULL AND ({TOLD_WORDS.text}) @@ (SELECT words FROM asked) OFFSET 0
        ) AS found JOIN jobs ON jobs.id = found.job_id
        WHERE {WANTED} LIMIT :most
    ),
    shown AS (
        SELECT first.job_id, first.sequence, jobs.task, jobs.model, jobs.seed, jobs.outcome,
            jobs.created_at
        FROM (SELECT job_id, min(sequence) AS sequence FROM told GROUP BY job_id) AS first
        JOIN jobs ON jobs.id = first.job_id
        ORDER BY jobs.created_at DESC, jobs.id LIMIT :limit
    )
    SELECT
        shown.job_id, shown.task, shown.model, shown.seed, shown.outcome, 'prompt' AS place,
        taken.turn, (SELECT count(*) FROM told) >= :most AS crowded,
        ts_headline('english', concat_ws(
            E'\n\n', said.told ->> 'system',
            (
                SELECT string_agg(text, E'\\n\\n')
                FROM json_array_elements_text(said.told -> 'user') AS text
            )
        ), (SELECT words FROM asked), :options) AS excerpt
    FROM shown
    JOIN journal AS said ON said.job_id = shown.job_id AND said.sequence = shown.sequence
    LEFT JOIN LATERAL (
        SELECT (data ->> 'index')::int AS turn FROM events
        WHERE events.job_id = shown.job_id AND events.kind = '{TURN}'
            AND (events.data ->> 'sequence')::int = shown.sequence LIMIT 1
    ) AS taken ON TRUE
    ORDER BY shown.created_at DESC, shown.job_id
    """  # noqa: S608 - made of our own constants
).bindparams(*(bindparam(name, type_=Text()) for name in TEXTS))
