"""The search through the transcripts of all jobs."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from fastapi import APIRouter, Query
from pydantic import BaseModel, Field

from buildarena_api.dependencies import ContextDep, RegistryDep
from buildarena_api.http.problems import ProblemError, problem_responses
from buildarena_api.job_filters import require_known
from buildarena_api.schemas import AnyOutcome
from buildarena_backend.jobs.filters import JobFilter
from buildarena_backend.journal.transcript_search import TranscriptFilter
from buildarena_benchmark import ValidationIssue

SHARED: Final = ("task", "model", "seed", "outcome", "turn", "where")
router = APIRouter(prefix="/v1/transcripts", tags=["jobs"])


class ExcerptPiece(BaseModel):
    """A piece of the text around a match."""

    text: str
    match: bool = Field(description="Whether it is one of the words")


class TranscriptMatchView(BaseModel):
    """A turn in which the words stand."""

    job: str = Field(description="Id of the turn's job")
    task: str
    model: str
    seed: int
    outcome: AnyOutcome | None = Field(description="null while the job has not ended")
    turn: int | None = Field(
        description="Place in the transcript, from 0; null where only the reply is kept"
    )
    where: Literal["reply", "feedback", "prompt"] = Field(
        description="In what was said, in what it was answered, or in what the role was told before"
    )
    excerpt: list[ExcerptPiece]


class TranscriptMatchesView(BaseModel):
    """What a search came to."""

    matches: list[TranscriptMatchView] = Field(description="Those of the newest jobs first")
    complete: bool = Field(description="false when there are more than are here")


@router.get("", responses=problem_responses(404, 422, 503))
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
    task: Annotated[str | None, Query()] = None,
    model: Annotated[str | None, Query()] = None,
    sweep: Annotated[str | None, Query(description="Only of this sweep's jobs")] = None,
    of: Annotated[
        Literal["transcripts", "prompts"],
        Query(description="prompts: what roles were told; the first turn of each job is found"),
    ] = "transcripts",
    limit: Annotated[int, Query(ge=1, le=200)] = 50,
) -> TranscriptMatchesView:
    """Searches the transcripts of all jobs for words, in what models said and were answered.

    With `of=prompts`, in system messages, tasks and results that sessions told their roles.
    Histories that were packed are not searched.
    """
    if "\0" in text or not context.store.turns.has_words(text):
        message = f"{text!r} has no word to search for"
        issue = ValidationIssue(path="text", message=message)
        raise ProblemError(422, f"text: {message}", errors=[issue])
    if sweep is not None:
        context.store.sweeps.get(sweep)
    wanted = TranscriptFilter(task=task, model=model, sweep_id=sweep, prompts=of == "prompts")
    found = context.store.turns.search(text, wanted, limit=limit)
    if not found.matches:
        require_known(context, registry, JobFilter(equals={"task": task, "model": model}))
    return TranscriptMatchesView(
        matches=[
            TranscriptMatchView.model_validate(
                {
                    **{name: getattr(match, name) for name in SHARED},
                    "job": match.job_id,
                    "excerpt": [
                        ExcerptPiece(text=piece, match=hit) for piece, hit in match.excerpt
                    ],
                }
            )
            for match in found.matches
        ],
        complete=found.complete,
    )
