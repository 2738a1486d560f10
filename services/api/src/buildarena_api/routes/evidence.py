"""Routes of evidence: what evenings with the real game showed."""

from __future__ import annotations

import hashlib
from datetime import datetime
from typing import Annotated, Final

from fastapi import APIRouter, Depends, Path, Request, Response
from pydantic import BaseModel, Field

from buildarena_api.dependencies import ContextDep, ExportingDep
from buildarena_api.evidence_uploads import shared_evidence_checker
from buildarena_api.http.access import CallerDep, admin_only
from buildarena_api.http.concurrency import limited
from buildarena_api.http.limits import whole_body
from buildarena_api.http.problems import ProblemError, problem_responses
from buildarena_pipeline.evidence import EvidenceTable, Verdict
from buildarena_pipeline.evidence.archive_names import MAX_BYTES
from buildarena_pipeline.runtime.context import Context
from buildarena_store import StoredEvidence

PATH: Final = "/v1/besiege/evidence"
ZIP: Final = "application/zip"
router = APIRouter(prefix="/v1/besiege", tags=["besiege"])
_ORDINARY = [limited("ordinary")]


class EvidenceView(BaseModel):
    """A file of evidence; its whole table with one, figures of it in lists."""

    id: str = Field(description="SHA-256 of the file")
    game: str
    mod: str
    build: str
    made_at: datetime
    created_at: datetime
    verdicts: dict[Verdict, int] = Field(description="How often each was found")
    differing: int = Field(description="Verdicts of its sender that its files do not bear out")


class EvidenceDetail(EvidenceView):
    """A file of evidence with its table."""

    table: EvidenceTable


class AddedEvidence(EvidenceDetail):
    """A file of evidence that was sent."""

    added: bool = Field(description="Whether it was not there before")


@router.post(
    "/evidence",
    status_code=201,
    dependencies=[limited("archives", until="request"), Depends(admin_only)],
    responses={
        200: {"description": "It was there", "model": AddedEvidence},
        **problem_responses(413, 422, 503),
    },
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {ZIP: {"schema": {"type": "string", "format": "binary"}}},
        }
    },
)
async def add_evidence(
    request: Request, response: Response, exporting: ExportingDep, caller: CallerDep
) -> AddedEvidence:
    """Adds what `buildarena besiege first-evening` packed. For admins.

    No verdict in it is believed: its logs and machine files are read and judged here, and the
    sender's verdicts that they do not bear out are marked. The same file twice changes nothing.
    """
    data = await whole_body(request, MAX_BYTES, "a file of evidence")
    stored, added = await exporting.run(_add, exporting.context, data, caller.key_id)
    response.status_code = 201 if added else 200
    response.headers["Location"] = f"{PATH}/{stored.hash}"
    return AddedEvidence(added=added, **_detail(stored).model_dump())


@router.get("/evidence", dependencies=_ORDINARY, responses=problem_responses(503))
def list_evidence(context: ContextDep) -> list[EvidenceView]:
    """Lists what evenings with the game showed, the newest first, 200 at most."""
    return [_detail(stored) for stored in context.store.evidence.newest()]


@router.get(
    "/evidence/{id}", dependencies=_ORDINARY, responses=problem_responses(404, 409, 422, 503)
)
def show_evidence(
    id_: Annotated[str, Path(alias="id", pattern="^[0-9a-f]{4,64}$")], context: ContextDep
) -> EvidenceDetail:
    """Shows one file's table: assumed, expected, seen, verdict, and how far engines agree.

    The beginning of an id is enough.
    """
    return _detail(_named(context, id_))


@router.get(
    "/evidence/{id}/file",
    dependencies=_ORDINARY,
    response_class=Response,
    responses={200: {"content": {ZIP: {}}}, **problem_responses(404, 409, 422, 503)},
)
def evidence_file(
    id_: Annotated[str, Path(alias="id", pattern="^[0-9a-f]{4,64}$")], context: ContextDep
) -> Response:
    """The file itself, with its logs, machine files and pictures, as it was sent."""
    stored = _named(context, id_)
    headers = {"Content-Disposition": f'attachment; filename="evidence-{stored.hash[:12]}.zip"'}
    return Response(context.artifacts.get(stored.hash), media_type=ZIP, headers=headers)


def _add(context: Context, data: bytes, owner: str | None) -> tuple[StoredEvidence, bool]:
    known = context.store.evidence.find(hashlib.sha256(data).hexdigest())
    if known:
        return known[0], False
    judged = shared_evidence_checker().read(data)
    info = context.artifacts.put(data, ZIP)
    table = judged.table.model_dump(mode="json")
    added = context.store.evidence.add(info, made_at=judged.made_at, judged=table, owner=owner)
    return context.store.evidence.find(info.hash)[0], added


def _named(context: Context, beginning: str) -> StoredEvidence:
    stored = context.store.evidence.find(beginning)
    if not stored:
        raise ProblemError(404, f"there is no evidence {beginning}; {PATH} lists what there is")
    if len(stored) > 1:
        raise ProblemError(409, f"more than one id begins with {beginning}: name more of it")
    return stored[0]


def _detail(stored: StoredEvidence) -> EvidenceDetail:
    table = EvidenceTable.model_validate(stored.judged)
    verdicts = [row.verdict for row in table.rows]
    return EvidenceDetail(
        id=stored.hash,
        game=table.game,
        mod=table.mod,
        build=table.build,
        made_at=stored.made_at,
        created_at=stored.created_at,
        verdicts={verdict: verdicts.count(verdict) for verdict in Verdict},
        differing=sum(row.stated is not None for row in table.rows),
        table=table,
    )
