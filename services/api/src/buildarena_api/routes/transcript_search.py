"""The search through the transcripts of all jobs."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Query
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from buildarena_api.dependencies import ContextDep, RegistryDep
from buildarena_api.http.pages import Page, PagingDep, seal
from buildarena_api.http.problems import invalid
from buildarena_api.job_filters import require_known
from buildarena_backend.jobs.filters import JobFilter
from buildarena_backend.journal.transcript_search import TranscriptFilter
from buildarena_backend.states import Outcome

router = APIRouter(prefix="/v1/transcripts", tags=["jobs"])


class ExcerptPiece(BaseModel):
    """A piece of the text around a match."""

    text: str
    match: bool = Field(description="Whether it is one of the words")


class TranscriptMatchView(BaseModel):
    """A turn in which the words stand."""

    model_config = ConfigDict(from_attributes=True)

    job_id: str
    task: str
    model: str
    seed: int
    outcome: Outcome | None = Field(description="null while the job has not ended")
    turn: int | None = Field(
        description="Place in the transcript, from 0; null where only the reply is kept"
    )
    where: Literal["reply", "feedback"] = Field(
        description="In what was said, or in what it was answered"
    )
    excerpt: Annotated[
        list[ExcerptPiece],
        BeforeValidator(lambda pieces: [{"text": text, "match": hit} for text, hit in pieces]),
    ]


@router.get("")
def search_transcripts(
    context: ContextDep,
    registry: RegistryDep,
    *,
    text: Annotated[
        str,
        Query(
            min_length=1,
            max_length=200,
            description='Words in any of their forms; "a phrase", or, -not as in search engines',
        ),
    ],
    paging: PagingDep,
    task: Annotated[list[str] | None, Query(description="Only on these tasks")] = None,
    model: Annotated[list[str] | None, Query(description="Only by these models")] = None,
    sweep: Annotated[list[str] | None, Query(description="Only of these sweeps' jobs")] = None,
) -> Page[TranscriptMatchView]:
    """Searches the transcripts of all jobs for words, in what models said and were answered."""
    if "\0" in text or not context.store.turns.has_words(text):
        raise invalid("text", f"{text!r} has no word to search for")
    for sweep_id in sweep or ():
        context.store.sweeps.get(sweep_id)
    wanted = TranscriptFilter(tasks=task, models=model, sweep_ids=sweep)
    first = paging.number or 0
    found = context.store.turns.search(text, wanted, limit=paging.limit + 1, offset=first)
    if not found:
        require_known(context, registry, JobFilter(equals={"task": task, "model": model}))
    shown, following = paging.cut(found, lambda _: seal([first + paging.limit]))
    return Page[TranscriptMatchView].model_validate({"data": shown, "next_cursor": following})
