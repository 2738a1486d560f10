"""Routes of challenges: seasons, their boards, and the packages that people hand in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Annotated, Any, Final, Literal

from fastapi import APIRouter, Depends, Path, Query, Request, Response
from pydantic import BaseModel, Field

from buildarena_api.dependencies import ContextDep, ExportingDep
from buildarena_api.http.access import Caller, CallerDep, admin_only
from buildarena_api.http.concurrency import limited
from buildarena_api.http.limits import whole_body
from buildarena_api.http.problems import ProblemError, problem_responses
from buildarena_api.package_checks import PackageChecks
from buildarena_pipeline.challenges.package import MAX_BYTES
from buildarena_pipeline.challenges.scores import ranks_of
from buildarena_pipeline.challenges.season import Season
from buildarena_pipeline.runtime.context import Context
from buildarena_store import PackageState, StoredPackage, TooManyPackagesError

PATH: Final = "/v1/submissions"
CHECK_PATH: Final = "/v1/submissions/check"
ZIP: Final = "application/zip"
router = APIRouter(prefix="/v1", tags=["challenges"])
_ORDINARY = [limited("ordinary")]
_ZIP_BODY: Final[dict[str, Any]] = {
    "requestBody": {
        "required": True,
        "content": {ZIP: {"schema": {"type": "string", "format": "binary"}}},
    }
}

PackageId = Annotated[str, Path(pattern="^package_[0-9a-f]{20}$")]
Reason = Annotated[str, Field(min_length=1, max_length=1000)]


class HandedIn(BaseModel):
    """What a package is handed in as."""

    season: str
    track: str
    name: str = Field(
        min_length=1, max_length=80, pattern=r"^[^\x00-\x1f\x7f]+$", description="Of the entry"
    )


class SeasonView(BaseModel):
    """A season: its rules, its formula and what of it nobody published."""

    season: Season
    unknown: list[str] = Field(description="Parameters of the score that the operator has to give")
    is_open: bool = Field(description="Whether packages are taken now")


class PackageView(BaseModel):
    """A package, as everybody may see it."""

    id: str
    season: str
    track: str
    name: str
    state: PackageState
    points: float | None = Field(description="By which it is ranked: final, or what is known of it")
    cost: int | None
    created_at: datetime
    checked_at: datetime | None


class PackageChangeView(BaseModel):
    """Who changed a package's state, and why."""

    changed_by: str = Field(description='Id of the API key; "" for the operator')
    state_before: PackageState
    state: PackageState
    reason: str
    at: datetime


class PackageDetail(PackageView):
    """A package, as its owner and admins see it; everybody once its season is closed."""

    hash: str = Field(description="SHA-256 of the ZIP file")
    owner: str = Field(description='Id of the API key; "" for the operator')
    reason: str | None = Field(description="Why it was refused, accepted or withdrawn")
    report: dict[str, Any] | None = Field(description="Every check, and the score term by term")
    changes: list[PackageChangeView]
    copies: list[str] = Field(description="Packages of others that are nearly the same; for admins")


class PackageReport(BaseModel):
    """What a season's checks find of a file."""

    passed: bool
    reason: str = Field(description='The first rule that it breaks, in a sentence; "" where none')
    report: dict[str, Any] = Field(description="Every check, and the score term by term")
    points: float | None = Field(description="By which it would be ranked")
    cost: int | None


class ReceivedPackage(PackageDetail):
    """A package that was handed in."""

    added: bool = Field(description="Whether this owner had not handed it in before")


class Ranked(BaseModel):
    """A row of a season's board; equal points share a rank."""

    rank: int
    package: PackageView


class Decision(BaseModel):
    """What an organiser decides of a package that was checked."""

    state: Literal[PackageState.ACCEPTED, PackageState.REFUSED]
    reason: Reason


def seasons_of(request: Request) -> Mapping[str, Season]:
    """The seasons that this service knows, by name."""
    seasons: Mapping[str, Season] = request.app.state.seasons
    return seasons


SeasonsDep = Annotated[Mapping[str, Season], Depends(seasons_of)]


@router.get("/seasons", dependencies=_ORDINARY)
def list_seasons(seasons: SeasonsDep) -> list[SeasonView]:
    """Lists the seasons of challenges."""
    return [_season_view(season) for season in seasons.values()]


@router.get("/seasons/{name}", dependencies=_ORDINARY, responses=problem_responses(404))
def show_season(name: str, seasons: SeasonsDep) -> SeasonView:
    """Shows a season."""
    return _season_view(season_of(seasons, name))


@router.get("/seasons/{name}/board", dependencies=_ORDINARY, responses=problem_responses(404, 503))
def season_board(
    name: str, seasons: SeasonsDep, context: ContextDep, track: str | None = None
) -> list[Ranked]:
    """Ranks a track's packages by their points, the cheaper and then the earlier first.

    Of packages of one owner and name the newest stands for all. Without a track it is the season's
    first.
    """
    season = season_of(seasons, name)
    track = track or next(iter(season.tracks))
    _require_track(season, track)
    rows = context.store.packages.board(name, track)
    ranks = ranks_of([row.points or 0.0 for row in rows])
    return [Ranked(rank=rank, package=_view(row)) for rank, row in zip(ranks, rows, strict=True)]


@router.post(
    "/submissions/check",
    dependencies=[limited("packages", until="request")],
    responses=problem_responses(404, 413, 422, 429, 503),
    openapi_extra=_ZIP_BODY,
)
async def check_package(
    season: str, track: str, request: Request, exporting: ExportingDep
) -> PackageReport:
    """Says what a season's checks find of a ZIP file, and keeps nothing of it."""
    rules = season_of(seasons_of(request), season)
    _require_track(rules, track)
    checks: PackageChecks = request.app.state.package_checks
    checked = await exporting.run(
        checks.look, await whole_body(request, MAX_BYTES, "a package"), rules, track
    )
    return PackageReport(
        passed=checked.passed,
        reason=checked.reason,
        report=dict(checked.report),
        points=checked.points,
        cost=checked.cost,
    )


@router.post(
    "/submissions",
    status_code=201,
    dependencies=[limited("packages", until="request")],
    responses={
        200: {"description": "It was there", "model": ReceivedPackage},
        **problem_responses(404, 409, 413, 422, 429, 503),
    },
    openapi_extra=_ZIP_BODY,
)
async def submit_package(
    request: Request,
    response: Response,
    entry: Annotated[HandedIn, Query()],
    exporting: ExportingDep,
    caller: CallerDep,
) -> ReceivedPackage:
    """Hands in a package, a ZIP file with the season's files; it is checked within seconds.

    The same file twice is one package. A package with the name of an earlier one replaces it on the
    board once it is scored.
    """
    season = season_of(seasons_of(request), entry.season)
    _require_track(season, entry.track)
    _require_open(season)
    data = await whole_body(request, MAX_BYTES, "a package")
    stored, added = await exporting.run(
        _receive, exporting.context, data, entry, season, caller.key_id or ""
    )
    response.status_code = 201 if added else 200
    response.headers["Location"] = f"{PATH}/{stored.id}"
    detail = await exporting.run(_detail, exporting.context, stored, caller)
    return ReceivedPackage(added=added, **detail.model_dump())


@router.get("/submissions", dependencies=_ORDINARY, responses=problem_responses(422, 503))
def list_packages(
    context: ContextDep,
    caller: CallerDep,
    season: str | None = None,
    state: PackageState | None = None,
    own: Annotated[bool, Query(description="Only those of the key that asks")] = False,
) -> list[PackageView]:
    """Lists packages, the newest first, 200 at most."""
    owner = (caller.key_id or "") if own else None
    listed = context.store.packages.listed(season=season, state=state, owner=owner)
    return [_view(package) for package in listed]


@router.get(
    "/submissions/{package}",
    dependencies=_ORDINARY,
    responses=problem_responses(403, 404, 422, 503),
)
def show_package(
    package: PackageId,
    seasons: SeasonsDep,
    context: ContextDep,
    caller: CallerDep,
) -> PackageDetail:
    """Shows a package with every check; before its season is closed only to its owner."""
    stored = context.store.packages.show(package)
    require_sight(stored, seasons, caller)
    return _detail(context, stored, caller)


@router.get(
    "/submissions/{package}/file",
    dependencies=_ORDINARY,
    response_class=Response,
    responses={200: {"content": {ZIP: {}}}, **problem_responses(403, 404, 422, 503)},
)
def package_file(
    package: PackageId,
    seasons: SeasonsDep,
    context: ContextDep,
    caller: CallerDep,
) -> Response:
    """The file as it was handed in, so that anybody who may see it can check it again."""
    stored = context.store.packages.show(package)
    require_sight(stored, seasons, caller)
    headers = {"Content-Disposition": f'attachment; filename="{stored.id}.zip"'}
    return Response(context.artifacts.get(stored.hash), media_type=ZIP, headers=headers)


@router.post(
    "/submissions/{package}/decision",
    dependencies=[*_ORDINARY, Depends(admin_only)],
    responses=problem_responses(404, 409, 422, 503),
)
def decide_package(
    package: PackageId,
    decision: Decision,
    context: ContextDep,
    caller: CallerDep,
) -> PackageDetail:
    """Accepts or refuses a package that was checked, with a reason that stays. For admins."""
    stored = context.store.packages.decide(
        package, decision.state, reason=decision.reason, by=caller.key_id or ""
    )
    return _detail(context, stored, caller)


@router.post(
    "/submissions/{package}/withdraw",
    dependencies=_ORDINARY,
    responses=problem_responses(403, 404, 409, 422, 503),
)
def withdraw_package(package: PackageId, context: ContextDep, caller: CallerDep) -> PackageDetail:
    """Takes a package off its board; its owner or an admin may."""
    stored = context.store.packages.decide(
        package,
        PackageState.WITHDRAWN,
        reason="withdrawn by its owner" if not caller.is_admin else "withdrawn by an admin",
        by=caller.key_id or "",
        owner=None if caller.is_admin else caller.key_id,
    )
    return _detail(context, stored, caller)


def _receive(
    context: Context, data: bytes, entry: HandedIn, season: Season, owner: str
) -> tuple[StoredPackage, bool]:
    info = context.artifacts.put(data, ZIP)
    try:
        return context.store.packages.receive(
            info,
            season=season.name,
            track=entry.track,
            name=entry.name,
            owner=owner,
            most_a_day=season.attempts_a_day,
        )
    except TooManyPackagesError as error:
        raise ProblemError(429, str(error), headers={"Retry-After": "3600"}) from error


def season_of(seasons: Mapping[str, Season], name: str) -> Season:
    """A season that the service knows.

    Raises:
        ProblemError: There is none of this name.
    """
    if name not in seasons:
        raise ProblemError(404, f"there is no season {name[:60]!r}; there is {_listed(seasons)}")
    return seasons[name]


def _require_track(season: Season, track: str) -> None:
    if track not in season.tracks:
        detail = f"{season.name} has no track {track[:60]!r}; there is {_listed(season.tracks)}"
        raise ProblemError(404, detail)


def _listed(names: Sequence[str] | Mapping[str, Any]) -> str:
    return ", ".join(names) or "none"


def _require_open(season: Season) -> None:
    now = datetime.now(UTC)
    if season.opens is not None and now < season.opens:
        raise ProblemError(409, f"{season.name} opens at {season.opens.isoformat()}")
    if season.closes is not None and now >= season.closes:
        raise ProblemError(409, f"{season.name} was closed at {season.closes.isoformat()}")


def _is_over(season: Season | None) -> bool:
    return season is not None and season.closes is not None and datetime.now(UTC) >= season.closes


def require_sight(package: StoredPackage, seasons: Mapping[str, Season], caller: Caller) -> None:
    """Before a season is closed nobody learns from another's package.

    Raises:
        ProblemError: The caller may not see it.
    """
    is_own = package.owner == (caller.key_id or "")
    if not (is_own or caller.is_admin or _is_over(seasons.get(package.season))):
        raise ProblemError(
            403, "it was handed in with another key; it can be seen once its season is closed"
        )


def _season_view(season: Season) -> SeasonView:
    try:
        _require_open(season)
    except ProblemError:
        is_open = False
    else:
        is_open = True
    return SeasonView(season=season, unknown=list(season.unknown), is_open=is_open)


def _view(package: StoredPackage) -> PackageView:
    return PackageView(**{name: getattr(package, name) for name in PackageView.model_fields})


def _detail(context: Context, package: StoredPackage, caller: Caller) -> PackageDetail:
    store = context.store.packages
    return PackageDetail(
        **_view(package).model_dump(),
        hash=package.hash,
        owner=package.owner,
        reason=package.reason,
        report=None if package.report is None else dict(package.report),
        changes=[
            PackageChangeView.model_validate(change, from_attributes=True)
            for change in store.changes(package.id)
        ],
        copies=store.alike(package) if caller.is_admin else [],
    )
