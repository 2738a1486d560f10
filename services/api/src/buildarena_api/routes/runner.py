"""The runner protocol: simulation workers that reach nothing but this API.

A runner leases a trial, sends heartbeats while it runs it, uploads the result's files and reports
the outcome; docs/runners.md describes the protocol. The score is computed here, never sent.
"""

# ruff: noqa: FAST003 - what names a lease and a file in paths is read by dependencies

from __future__ import annotations

from tempfile import TemporaryFile
from typing import Annotated, Any, Final

from fastapi import APIRouter, Depends, Path, Request, Response
from fastapi.concurrency import run_in_threadpool

from buildarena_api.access import RightsDep, RunnerRights, limited, runner_of
from buildarena_api.dependencies import ContextDep, ServicesDep
from buildarena_api.http.bodies import receive_file
from buildarena_api.http.problems import ErrorCode, ProblemError, invalid
from buildarena_api.runners.lease_queue import MAX_NAMES, LeaseGrant, LeaseQuery
from buildarena_api.runners.views import (
    Heartbeat,
    LeasedTrial,
    LeaseEnd,
    LeaseRequest,
    LeaseStates,
    RunnerName,
    RunnerReport,
    RunnerTerms,
    TrialFault,
    TrialOutcome,
)
from buildarena_backend.artifacts.uploads import MAX_FILE_BYTES, MAX_LEASE_BYTES
from buildarena_backend.errors import UploadError
from buildarena_backend.leases.leases import JobToken
from buildarena_backend.states import simulate_queue
from buildarena_backend.trials.known_simulators import known_simulators

PREFIX: Final = "/v1/runner"
OCTETS: Final = "application/octet-stream"
router = APIRouter(prefix=PREFIX, tags=["runner"])

_ORDINARY = limited("ordinary", caller=runner_of)


MAX_REQUEST_BYTES: Final = 64 * 1024
"""Largest request of a runner but for an upload."""


def is_upload(path: str) -> bool:
    """Return whether a path takes an uploaded file."""
    return path.startswith(f"{PREFIX}/leases/") and "/uploads/" in path


def max_request_bytes(path: str) -> int | None:
    """Return the largest request that a path takes, if it is a runner's."""
    if is_upload(path):
        return MAX_FILE_BYTES
    is_runners = path == PREFIX or path.startswith(PREFIX + "/")
    return MAX_REQUEST_BYTES if is_runners else None


def _job_token(
    job_id: Annotated[str, Path(pattern=r"^job_[0-9a-f]{1,40}$")],
    token: Annotated[int, Path(ge=1, lt=2**63, description="The lease's fencing token")],
) -> JobToken:
    return job_id, token


NamedDep = Annotated[JobToken, Depends(_job_token)]
"""Start of the names of the key's runners."""


@router.get("", dependencies=[_ORDINARY])
def show_runner(rights: RightsDep, context: ContextDep) -> RunnerTerms:
    """Return a runner's terms: the simulators whose jobs it may lease, versions, limits."""
    simulators = known_simulators(context)
    allowed = list(simulators if rights.simulators is None else rights.simulators)
    return RunnerTerms(
        simulators=allowed,
        versions={name: simulators[name].version for name in allowed if name in simulators},
        lease_s=context.settings.lease_s,
        max_file_bytes=MAX_FILE_BYTES,
        max_lease_bytes=MAX_LEASE_BYTES,
    )


@router.post(
    "/leases",
    dependencies=[limited("runner_waits", caller=runner_of)],
    responses={204: {"description": "There is none now"}},
    response_model=LeasedTrial,
)
async def lease_trial(
    lease_request: LeaseRequest, rights: RightsDep, services: ServicesDep, request: Request
) -> Any:
    """Lease the next trial, waiting for one for up to `wait_s` seconds; 204 when there is none.

    A name has one lease at a time: another request under it gets the same lease.
    """
    _require_allowed(lease_request, rights)
    leased = await services.lease_queue.grant(
        LeaseQuery(
            simulators=tuple(sorted(lease_request.simulators.items())),
            job_owners=None if rights.job_owners is None else tuple(rights.job_owners),
        ),
        owner=rights.prefix + lease_request.name,
        prefix=rights.prefix,
        wait_s=lease_request.wait_s,
        left=request.is_disconnected,
    )
    if leased is None:
        return Response(status_code=204)
    return _view(leased, services.context.settings.lease_s)


@router.post("/heartbeat", dependencies=[_ORDINARY])
def send_heartbeat(body: Heartbeat, rights: RightsDep, context: ContextDep) -> LeaseStates:
    """Keep leases alive, many in one request, and return which are over."""
    _require_allowed(body, rights)
    store, prefix = context.store, rights.prefix
    owner = prefix + body.name
    if store.runner_leases.counts(prefix, besides=owner)["names"] >= MAX_NAMES:
        raise ProblemError(
            ErrorCode.TOO_MANY_OPEN,
            f"the key's runners had {MAX_NAMES} names within a minute, as many as they may",
            headers={"Retry-After": "30"},
        )
    store.workers.report(
        worker_id=owner,
        kind="simulate",
        queues=[simulate_queue(simulator) for simulator in sorted(body.simulators)],
        host=body.name,
        pid=body.pid,
        versions=body.versions,
        peak_memory_bytes=body.peak_memory_bytes,
        reported_at=body.reported_at,
    )
    # Old names of the key leave the register long before they would be forgotten.
    store.workers.trim(prefix, limit=MAX_NAMES)
    live = store.runner_leases.heartbeat([(ref.job_id, ref.token) for ref in body.leases], prefix)
    answer = LeaseStates(live=[], lost=[])
    for ref in body.leases:
        is_live = (ref.job_id, ref.token) in live
        (answer.live if is_live else answer.lost).append(ref)
    return answer


@router.delete("/workers/{name}", status_code=204, dependencies=[_ORDINARY])
def leave(name: RunnerName, rights: RightsDep, context: ContextDep) -> None:
    """Take a runner that shuts down off the list of workers; leases that it still has go back."""
    context.store.runner_leases.hand_back(rights.prefix + name)
    if not context.store.workers.leave(rights.prefix + name):
        raise ProblemError(ErrorCode.WORKER_NOT_FOUND, f"the key has no runner {name!r}")


@router.put(
    "/leases/{job_id}/{token}/uploads/{sha256}",
    status_code=204,
    dependencies=[limited("uploads", caller=runner_of)],
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {OCTETS: {"schema": {"type": "string", "format": "binary"}}},
        }
    },
)
async def upload_file(
    named: NamedDep,
    sha256: Annotated[str, Path(pattern=r"^[0-9a-f]{64}$", description="Of the whole file")],
    request: Request,
    rights: RightsDep,
    services: ServicesDep,
) -> None:
    """Take a whole file; one that was received before changes nothing."""
    await run_in_threadpool(services.context.store.runner_leases.live, *named, rights.prefix)
    with TemporaryFile() as file:
        if await receive_file(request, file, max_bytes=MAX_FILE_BYTES) != sha256:
            raise UploadError("the file's SHA-256 is not the one in the path: send it again")
        await run_in_threadpool(services.uploads.keep, named, sha256, file)


@router.post(
    "/leases/{job_id}/{token}/outcome",
    dependencies=[limited("runner_outcomes", caller=runner_of)],
)
def complete_trial(
    named: NamedDep, body: TrialOutcome, rights: RightsDep, services: ServicesDep
) -> LeaseEnd:
    """Report the outcome of a trial, which is checked and scored here; end the lease."""
    return LeaseEnd(status=services.outcomes.complete(named, rights.prefix, body))


@router.post(
    "/leases/{job_id}/{token}/fault",
    dependencies=[limited("runner_outcomes", caller=runner_of)],
)
def report_fault(
    named: NamedDep, body: TrialFault, rights: RightsDep, services: ServicesDep
) -> LeaseEnd:
    """Report that the runner or its simulator failed; end the lease."""
    return LeaseEnd(status=services.outcomes.fault(named, rights.prefix, body))


@router.post("/leases/{job_id}/{token}/release", dependencies=[_ORDINARY])
def hand_back(named: NamedDep, rights: RightsDep, services: ServicesDep) -> LeaseEnd:
    """Give a trial back without fault, as at shutdown; end the lease."""
    return LeaseEnd(status=services.outcomes.hand_back(named, rights.prefix))


def _require_allowed(about: RunnerReport, rights: RunnerRights) -> None:
    choices = tuple(about.simulators if rights.simulators is None else rights.simulators)
    for name in about.simulators:
        if name not in choices:
            message = f"the key may not lease jobs of {name}"
            raise invalid("simulators", message, choices=choices, code=ErrorCode.NOT_ALLOWED)


def _view(leased: LeaseGrant, lease_s: float) -> LeasedTrial:
    lease, due = leased
    controls = due.request.controls
    return LeasedTrial(
        job_id=lease.job.id,
        token=lease.token,
        lease_s=lease_s,
        simulator=due.request.engine,
        version=due.version,
        number=due.request.number,
        task=dict(due.task.as_document()),
        machine=due.machine.to_document(),
        controls=None if controls is None else [dict(press) for press in controls],
        seed=due.request.seed,
    )
