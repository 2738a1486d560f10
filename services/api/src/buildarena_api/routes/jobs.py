"""Routes of jobs."""

from __future__ import annotations

from hashlib import sha256
from typing import Annotated, Final, Literal

from fastapi import APIRouter, Query, Request, Response

from buildarena_api.access import CallerDep, limited
from buildarena_api.dependencies import MAX_ROWS, ContextDep, RegistryDep, ServicesDep
from buildarena_api.http import cursors
from buildarena_api.http.places import Kind
from buildarena_api.http.problems import ProblemError, problem_responses
from buildarena_api.job_filters import JobFilterDep, require_known
from buildarena_api.routes.transcripts import as_markdown
from buildarena_api.schemas import (
    AttemptView,
    JobDetail,
    JobFileView,
    JobPage,
    JobSummaryView,
    JobView,
    PromptsView,
    PromptView,
)
from buildarena_api.withholding import require_told
from buildarena_backend.agents.turn_views import Transcripts
from buildarena_backend.artifacts.kinds import MEDIA_TYPES
from buildarena_backend.catalog.specs import JobSpec
from buildarena_backend.jobs.job import Job
from buildarena_backend.jobs.pages import Order, Sort, sort_value
from buildarena_backend.process.context import Context


def _kind(request: Request) -> Kind:
    """A page of a list is read in its order; what searches or counts looks through all jobs."""
    searches = not {"text", "flag"}.isdisjoint(request.query_params)
    return "heavy" if searches or request.url.path.endswith("/summary") else "ordinary"


router = APIRouter(prefix="/v1/jobs", tags=["jobs"], dependencies=[limited(_kind)])

DEFAULT_LIMIT: Final = 100


ARTIFACT_TYPES = {
    "machine": "application/json",
    "transcript": "application/json",
}


@router.post("", status_code=202, responses=problem_responses(422, 503))
def submit_job(
    spec: JobSpec, response: Response, services: ServicesDep, caller: CallerDep
) -> JobView:
    """Submits one job. An equal job that exists already is returned as it is, never redone."""
    job, _ = services.submissions.submit_job(spec, owner=caller.key_id)
    response.headers["Location"] = f"/v1/jobs/{job.id}"
    return JobView.of(job)


@router.get("", response_model=JobPage, responses=problem_responses(404, 422, 503))
def list_jobs(
    context: ContextDep,
    registry: RegistryDep,
    wanted: JobFilterDep,
    *,
    sort: Annotated[
        Sort, Query(description="Jobs without such a figure come last, in both directions")
    ] = "created",
    order: Annotated[
        Literal["asc", "desc"], Query(description="desc: the newest, or greatest, first")
    ] = "desc",
    cursor: Annotated[str | None, Query(max_length=1000)] = None,
    limit: Annotated[int, Query(ge=1, le=MAX_ROWS)] = DEFAULT_LIMIT,
) -> Response:
    """Lists jobs, newest first by default.

    A value that no job can have is refused with the choices. A cursor is good for the order that
    it was made in.
    """
    in_order = Order(by=sort, descending=order == "desc")
    found = context.store.jobs.page(
        limit=limit,
        after=None if cursor is None else cursors.decode_in(cursor, in_order),
        order=in_order,
        wanted=wanted,
    )
    if not found:
        require_known(context, registry, wanted)
    more = len(found) == limit
    page = JobPage(
        jobs=[JobView.of(job) for job in found],
        next_cursor=_cursor(in_order, found[-1]) if more else None,
    )
    # Made here: the event loop serves others meanwhile.
    return Response(page.model_dump_json(), media_type="application/json")


def _cursor(order: Order, job: Job) -> str:
    return cursors.encode_in(order, sort_value(job, order.by), job.id)


@router.get("/summary", responses=problem_responses(404, 422, 503))
def summarise_jobs(
    context: ContextDep, registry: RegistryDep, wanted: JobFilterDep
) -> JobSummaryView:
    """Counts a list's jobs by how they ended, by reason and by flag: what stands above the list."""
    counted = context.store.jobs.summary(wanted)
    if not counted.jobs:
        require_known(context, registry, wanted)
    return JobSummaryView.model_validate(counted)


@router.get("/{job_id}", responses=problem_responses(404, 503))
def show_job(job_id: str, context: ContextDep) -> JobDetail:
    """Shows a job with its manifest, attempts and artifacts."""
    job = context.store.jobs.get(job_id)
    return JobDetail(
        **JobView.of(job).model_dump(),
        manifest=None if job.manifest is None else dict(job.manifest),
        attempts=[AttemptView.model_validate(a) for a in context.store.jobs.attempts(job_id)],
        artifacts=context.store.jobs.artifacts(job_id),
    )


@router.get("/{job_id}/prompts", responses=problem_responses(404, 503))
def show_prompts(job_id: str, context: ContextDep) -> PromptsView:
    """What each role was told before its turns: system messages, the task, results of trials.

    Of a session under way, what was told so far. Very long messages are cut.
    What roles said to one another stands in the transcript and is not repeated. Nothing is known
    of agents' jobs, of jobs of releases that did not keep it, and of packed histories.
    """
    context.store.jobs.get(job_id)
    found = context.store.turns.prompts(job_id)
    return PromptsView(prompts=[PromptView.model_validate(prompt) for prompt in found])


@router.post("/{job_id}/cancel", responses=problem_responses(404, 409, 503))
def cancel_job(job_id: str, context: ContextDep, caller: CallerDep) -> JobView:
    """Ends a job that has not ended; the model request that is open ends at once.

    If another key wants the job too, it goes on at that key's expense, and the caller's claim
    ends. An admin ends it whoever wants it.
    """
    if not context.store.lifecycle.cancel_job(job_id, owner=caller.key_id, force=caller.is_admin):
        raise ProblemError(409, f"job {job_id} has ended already")
    return JobView.of(context.store.jobs.get(job_id))


@router.post("/{job_id}/retry", status_code=202, responses=problem_responses(404, 409, 503))
def retry_job(job_id: str, context: ContextDep, caller: CallerDep) -> JobView:
    """Queues an errored job where it failed, or a refuted one for its trial by a runner.

    A job whose score stands is never run again.
    """
    if not context.store.lifecycle.retry_job(job_id, owner=caller.key_id, force=caller.is_admin):
        job = context.store.jobs.get(job_id)
        state = job.outcome or job.state
        raise ProblemError(
            409,
            f"only errored jobs and refuted trials of runners are retried; job {job_id} is {state}",
        )
    job = context.store.jobs.get(job_id)
    context.queues.wake(job.queue)
    return JobView.of(job)


@router.get("/{job_id}/artifacts", responses=problem_responses(404, 503))
def list_artifacts(job_id: str, context: ContextDep) -> list[JobFileView]:
    """Lists all artifacts of a job, by name."""
    context.store.jobs.get(job_id)
    return [JobFileView.model_validate(file) for file in context.store.jobs.files(job_id)]


@router.get(
    "/{job_id}/artifacts/{name}",
    responses={
        200: {"content": {kind: {} for kind in MEDIA_TYPES}},
        **problem_responses(404, 503),
    },
    response_class=Response,
)
def get_artifact_by_name(job_id: str, name: str, context: ContextDep) -> Response:
    """An artifact of a job; its ETag is the SHA-256 of its bytes."""
    job = context.store.jobs.get(job_id)
    if name.startswith("trajectory-"):
        require_told(context, job)
    found = [file for file in context.store.jobs.files(job_id) if file.name == name]
    if not found:
        raise ProblemError(404, f"job {job_id} has no {name!r}")
    return Response(
        context.artifacts.get(found[0].hash),
        media_type=found[0].media_type,
        # What a runner or an archive brought must not run as a page of ours.
        headers={"ETag": f'"{found[0].hash}"', "Content-Security-Policy": "sandbox"},
    )


@router.get(
    "/{job_id}/{artifact}",
    responses={
        200: {
            "content": {kind: {} for kind in sorted({*ARTIFACT_TYPES.values(), "text/markdown"})}
        },
        **problem_responses(404, 422, 503),
    },
    response_class=Response,
)
def get_artifact(
    job_id: str,
    artifact: Literal["machine", "transcript"],
    context: ContextDep,
    style: Annotated[
        Literal["json", "markdown"], Query(description="markdown: a transcript for people")
    ] = "json",
) -> Response:
    """The machine document or the transcript of a job.

    The transcript of a session that is under way goes as far as that has come.
    """
    job = context.store.jobs.get(job_id)
    if artifact == "transcript":
        return _transcript(context, job, style)
    digest = context.store.jobs.artifacts(job_id).get(artifact)
    if digest is None:
        raise ProblemError(404, f"job {job_id} has no {artifact} yet")
    return Response(
        context.artifacts.get(digest),
        media_type=ARTIFACT_TYPES[artifact],
        headers={"ETag": f'"{digest}"'},
    )


def _transcript(context: Context, job: Job, style: str) -> Response:
    data = Transcripts(context.store, context.artifacts).read(job)
    if data is None:
        raise ProblemError(404, f"job {job.id} has no transcript yet")
    if style == "markdown":
        title = f"{job.task} by {job.model}, seed {job.seed}"
        return Response(as_markdown(data, title), media_type="text/markdown; charset=utf-8")
    return Response(
        data,
        media_type=ARTIFACT_TYPES["transcript"],
        headers={"ETag": f'"{sha256(data).hexdigest()}"'},
    )
