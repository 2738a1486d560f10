"""Routes of jobs, and the search through their transcripts."""

from __future__ import annotations

import json
import re
from collections import Counter
from hashlib import sha256
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Request, Response
from pydantic import BeforeValidator

from buildarena_api.access import CallerDep, limited
from buildarena_api.dependencies import ContextDep, RequestKey, ServicesDep
from buildarena_api.http.pages import Page, PagingDep, encode, seal
from buildarena_api.http.places import Kind
from buildarena_api.http.problems import ErrorCode, ProblemError, invalid
from buildarena_api.job_filters import JobFilterDep, require_known
from buildarena_api.job_records import (
    explain_job,
    machine_hash,
    no_artifact,
    read_trials,
    require_ended,
)
from buildarena_api.schemas import (
    EXISTED,
    JobDetail,
    JobView,
    PromptView,
    View,
    tell_created,
)
from buildarena_backend.agents.turn_views import Transcripts
from buildarena_backend.artifacts.kinds import MEDIA_TYPES
from buildarena_backend.catalog.specs import JobSpec
from buildarena_backend.jobs.filters import JobFilter
from buildarena_backend.jobs.job import Artifact
from buildarena_backend.jobs.pages import Order, Sort, sort_value
from buildarena_backend.jobs.summaries import JobSummary
from buildarena_backend.journal.turns import BEGIN, END
from buildarena_benchmark.outcomes import Outcome


def _kind(request: Request) -> Kind:
    """Return the kind of a request: searches and counts scan all jobs, pages do not."""
    searches = not {"text", "flag"}.isdisjoint(request.query_params)
    return "heavy" if searches or request.url.path.endswith("/summary") else "ordinary"


router = APIRouter(prefix="/v1/jobs", tags=["jobs"], dependencies=[limited(_kind)])
transcripts = APIRouter(prefix="/v1/transcripts", tags=["jobs"], dependencies=[limited("heavy")])

JSON = "application/json"


@router.post("", status_code=201, responses=EXISTED)
def submit_job(
    spec: JobSpec, response: Response, services: ServicesDep, caller: CallerDep, _: RequestKey
) -> JobView:
    """Submit one job. An equal job that exists already is returned as it is, never redone."""
    job, added = services.submissions.submit_job(spec, owner=caller.key_id)
    tell_created(response, f"/v1/jobs/{job.id}", is_new=added)
    return JobView.model_validate(job)


@router.get("", response_model=Page[JobView])
def list_jobs(
    services: ServicesDep,
    filters: JobFilterDep,
    *,
    sort: Annotated[
        Sort, Query(description="Jobs without such a figure come last, in both directions")
    ] = "created",
    order: Annotated[
        Literal["asc", "desc"], Query(description="desc: the newest, or greatest, first")
    ] = "desc",
    paging: PagingDep,
) -> Response:
    """List jobs, newest first by default.

    A value that no job can have is refused with the choices. A cursor is good for the order that
    it was made in.
    """
    in_order = Order(by=sort, descending=order == "desc")
    jobs = services.context.store.jobs.page(
        limit=paging.limit + 1,
        after=paging.after(in_order),
        order=in_order,
        job_filter=filters,
    )
    if not jobs:
        require_known(services, filters)
    shown, following = paging.cut(jobs, lambda job: encode(in_order, sort_value(job, sort), job.id))
    page = Page[JobView].model_validate({"data": shown, "next_cursor": following})
    # Made here: the event loop serves others meanwhile.
    return Response(page.model_dump_json(), media_type=JSON)


@router.get("/summary")
def summarise_jobs(services: ServicesDep, filters: JobFilterDep) -> JobSummary:
    """Count a list's jobs by outcome, by reason and by flag."""
    counted = services.context.store.jobs.summary(filters)
    if not counted.jobs:
        require_known(services, filters)
    return counted


@router.get("/{job_id}")
def show_job(job_id: str, context: ContextDep) -> JobDetail:
    """Show a job with its manifest, attempts and artifacts."""
    job = context.store.jobs.get(job_id)
    worlds, test_trials = read_trials(job, context)
    return JobDetail(
        **JobView.model_validate(job).model_dump(),
        test_trials=test_trials,
        explanation=explain_job(job, worlds),
        worlds=worlds,
        manifest=None if job.manifest is None else dict(job.manifest),
        attempts=context.store.jobs.attempts(job_id),
        retries=context.store.journal.retries(job_id),
        artifacts=context.store.jobs.artifacts(job_id),
        cached_tokens=job.usage["cached_tokens"],
        reasoning_tokens=job.usage["reasoning_tokens"],
    )


@router.get("/{job_id}/prompts")
def list_prompts(job_id: str, context: ContextDep, paging: PagingDep) -> Page[PromptView]:
    """List the messages to each role before its turns: system messages, the task, trial results.

    Of a session under way, those so far. Very long messages are cut. Messages between roles are
    in the transcript and are not repeated. The list is empty for agents' jobs, for jobs of releases
    that did not store them, and for packed histories.
    """
    context.store.jobs.get(job_id)
    prompts = context.store.turns.prompts(job_id)
    return Page[PromptView].model_validate(paging.of(prompts))


@router.post("/{job_id}/cancel")
def cancel_job(job_id: str, context: ContextDep, caller: CallerDep) -> JobView:
    """End a job that has not ended; the model request that is open ends at once.

    If another key wants the job too, it continues at that key's expense, and only the caller's
    claim ends. An admin ends it in any case.
    """
    if not context.store.lifecycle.cancel_job(job_id, owner=caller.key_id, force=caller.is_admin):
        raise ProblemError(ErrorCode.ILLEGAL_STATE, f"job {job_id} has ended already")
    return JobView.model_validate(context.store.jobs.get(job_id))


@router.post("/{job_id}/retry")
def retry_job(job_id: str, context: ContextDep, caller: CallerDep) -> JobView:
    """Queue an errored job where it failed, or a refuted one for its trial by a runner.

    A job with a valid score is never run again.
    """
    if not context.store.lifecycle.retry_job(job_id, owner=caller.key_id, force=caller.is_admin):
        job = context.store.jobs.get(job_id)
        state = job.outcome or job.state
        raise ProblemError(
            ErrorCode.ILLEGAL_STATE,
            f"only errored jobs and refuted trials of runners are retried; job {job_id} is {state}",
        )
    job = context.store.jobs.get(job_id)
    context.queues.wake(job.queue)
    return JobView.model_validate(job)


@router.get("/{job_id}/artifacts")
def list_artifacts(job_id: str, context: ContextDep, paging: PagingDep) -> Page[Artifact]:
    """List all artifacts of a job, by name."""
    context.store.jobs.get(job_id)
    return Page[Artifact].model_validate(paging.of(context.store.jobs.files(job_id)))


@router.get(
    "/{job_id}/artifacts/{artifact}",
    responses={
        200: {"content": {kind: {} for kind in MEDIA_TYPES}},
    },
    response_class=Response,
)
def get_artifact(job_id: str, artifact: str, context: ContextDep) -> Response:
    """Return an artifact of a job; its ETag is the SHA-256 of its bytes."""
    job = context.store.jobs.get(job_id)
    if artifact.startswith("trajectory-"):
        require_ended(context, job)
    files = [file for file in context.store.jobs.files(job_id) if file.name == artifact]
    if not files:
        raise no_artifact(job_id, repr(artifact))
    return Response(
        context.artifacts.get(files[0].sha256),
        media_type=files[0].media_type,
        # Content from a runner or an archive must not run as a page of ours.
        headers={"ETag": f'"{files[0].sha256}"', "Content-Security-Policy": "sandbox"},
    )


@router.get("/{job_id}/machine", response_class=Response, responses={200: {"content": {JSON: {}}}})
def get_machine(job_id: str, context: ContextDep) -> Response:
    """Return the machine document of a job."""
    digest = machine_hash(context, context.store.jobs.get(job_id))
    headers = {"ETag": f'"{digest}"'}
    return Response(context.artifacts.get(digest), media_type=JSON, headers=headers)


@router.get(
    "/{job_id}/transcript",
    response_class=Response,
    responses={200: {"content": {JSON: {}, "text/markdown": {}}}},
)
def get_transcript(
    job_id: str,
    context: ContextDep,
    style: Annotated[
        Literal["json", "markdown"], Query(alias="format", description="markdown: for people")
    ] = "json",
) -> Response:
    """Return the transcript of a job; of a session under way, its turns so far."""
    job = context.store.jobs.get(job_id)
    data = Transcripts(context.store, context.artifacts).read(job)
    if data is None:
        raise no_artifact(job_id, "transcript")
    if style == "markdown":
        title = f"{job.task} by {job.model}, seed {job.seed}"
        return Response(_as_markdown(data, title), media_type="text/markdown; charset=utf-8")
    return Response(data, media_type=JSON, headers={"ETag": f'"{sha256(data).hexdigest()}"'})


FENCE = "```"


def _as_markdown(data: bytes, title: str) -> str:
    """Return a kept transcript as a page.

    Args:
        data: The JSON document that is kept as the artifact.
        title: Heading of the page.
    """
    turns: list[dict[str, Any]] = json.loads(data)["turns"]
    lines = [f"# {title}", "", _summary(turns), ""]
    place: tuple[str, str | None] | None = None
    for turn in turns:
        heading = (turn["stage"], turn.get("sub_structure"))
        if heading != place:
            place = heading
            lines += [f"## {heading[0]}" + (f": {heading[1]}" if heading[1] else ""), ""]
        lines += _turn(turn)
    return "\n".join(lines)


def _summary(turns: list[dict[str, Any]]) -> str:
    actions = [action for turn in turns for action in turn["actions"]]
    refused = Counter(action["reason"] or "refused" for action in actions if not action["ok"])
    share = sum(refused.values()) / len(actions) if actions else 0.0
    rendered = ", ".join(f"{count} {name}" for name, count in refused.most_common()) or "none"
    return f"{len(turns)} turns, {len(actions)} actions, {share:.1%} of them refused ({rendered})."


def _turn(turn: dict[str, Any]) -> list[str]:
    cost = ""
    if "input_tokens" in turn:
        cost = (
            f" · {turn['input_tokens']:,} in, {turn['output_tokens']:,} out"
            f" · ${turn['cost_usd']} · {turn['latency_s']:.2f} s"
        )
    lines = [f"**{turn['index']} {turn['role']}**{cost}", ""]
    if turn["text"]:
        lines += [f"> {line}" for line in turn["text"].splitlines()] + [""]
    for action in turn["actions"]:
        mark = "accepted" if action["ok"] else f"refused: {action['reason']}"
        arguments = json.dumps(action["arguments"], ensure_ascii=False)
        lines += [f"`{action['name']}` {arguments} ({mark})", ""]
        lines += [FENCE, action["feedback"].replace(FENCE, "'''"), FENCE, ""]
    return lines


class ExcerptPiece(View):
    """A piece of the text around a match."""

    text: str
    match: bool
    """Whether it is one of the words."""


def _pieces(excerpt: str) -> list[ExcerptPiece]:
    """Return an excerpt cut where its matches begin and end."""
    pieces = re.split(f"({BEGIN}.*?{END})", excerpt, flags=re.DOTALL)
    return [
        ExcerptPiece(text=piece.strip(BEGIN + END), match=piece.startswith(BEGIN))
        for piece in pieces
        if piece
    ]


class TranscriptMatchView(View):
    """A turn that contains the words."""

    job_id: str
    task: str
    model: str
    seed: int
    outcome: Outcome | None
    """null while the job has not ended."""
    turn: int | None
    """Place in the transcript, from 0; null where only the reply is kept."""
    where: Literal["reply", "feedback"]
    """Place of the match: the reply, or the feedback to it."""
    excerpt: Annotated[list[ExcerptPiece], BeforeValidator(_pieces)]


@transcripts.get("")
def search_transcripts(
    services: ServicesDep,
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
    """Search the transcripts of all jobs for words, in models' replies and their feedback."""
    store = services.context.store
    if "\0" in text or not store.turns.has_words(text):
        raise invalid("text", f"{text!r} has no word to search for")
    for sweep_id in sweep or ():
        store.sweeps.get(sweep_id)
    first = paging.number or 0
    turns = store.turns.search(
        text, tasks=task, models=model, sweep_ids=sweep, limit=paging.limit + 1, offset=first
    )
    if not turns:
        require_known(services, JobFilter(equals={"task": task, "model": model}))
    shown, following = paging.cut(turns, lambda _: seal([first + paging.limit]))
    return Page[TranscriptMatchView].model_validate({"data": shown, "next_cursor": following})
