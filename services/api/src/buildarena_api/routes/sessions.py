"""Routes of external agents: open a session, call tools, submit."""

from __future__ import annotations

import contextlib
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Response
from pydantic import BaseModel, ConfigDict, Field

from buildarena_api.access import Caller, CallerDep
from buildarena_api.benches import BenchMachineView, machine_view
from buildarena_api.dependencies import ContextDep, ServicesDep
from buildarena_api.http.problems import ProblemError, problem_responses
from buildarena_api.schemas import JobView
from buildarena_backend.agents.briefing import LIMITS
from buildarena_backend.agents.sessions import SessionClosedError
from buildarena_backend.agents.trying import NoTestError
from buildarena_backend.catalog.specs import Name, Seed, Worlds
from buildarena_backend.errors import UnknownIdError
from buildarena_backend.process.context import Context
from buildarena_benchmark.environment import ASSEMBLY, MAIN, NothingToSubmitError, Workbench
from buildarena_benchmark.environment.tools import building_tools
from buildarena_simulation import DEFAULT_ENGINE

router = APIRouter(prefix="/v1/sessions", tags=["sessions"])

MachineName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,40}$")]


class OpenSession(BaseModel):
    """A request to build."""

    model_config = ConfigDict(extra="forbid")

    task: Name
    agent: Annotated[
        str,
        Field(
            description="Its name on the leaderboard, which belongs to the key that first uses it",
            max_length=80,
        ),
    ]
    seed: Seed = 0
    simulator: Name = DEFAULT_ENGINE
    kind: Annotated[
        Literal["agent", "human"],
        Field(
            description="Who builds: a program, on leaderboards `agent/NAME`, or a person, "
            "`human/NAME`. No name is of both kinds"
        ),
    ] = "agent"
    data_sheets: bool = Field(
        default=True,
        description="Tell each module's data and the world's; sessions with and without are "
        "ranked apart",
    )
    worlds: Worlds = None


class ToolView(BaseModel):
    """A tool that the agent may call."""

    name: str
    description: str
    parameters: dict[str, Any] = Field(description="JSON schema of its arguments")


class LimitsView(BaseModel):
    """How much a session may do."""

    model_config = ConfigDict(from_attributes=True)

    calls: int = Field(description="Calls it may make")
    session_bytes: int = Field(description="Bytes of all arguments and answers")
    call_bytes: int = Field(description="Bytes of one call's arguments")
    idle_s: int = Field(description="Seconds without a call after which it is cancelled")


class SessionOpened(BaseModel):
    """An open session."""

    id: str = Field(description="Also the id of the job that will hold the score")
    briefing: str = Field(
        description="All that an agent must know, as Markdown: how it plays, the statement, the "
        "frame, the rules, the modules with their data, and the world"
    )
    statement: str = Field(description="What to build; part of the briefing")
    tools: list[ToolView]
    limits: LimitsView
    calls: int = Field(description="Calls made so far; more than 0 if it was open already")


class TestTrialView(BaseModel):
    """A test trial: what was measured is told, and counts for nothing."""

    model_config = ConfigDict(from_attributes=True)

    number: int = Field(description="Which one it is, from 1")
    result: str | None = Field(description="What was measured, in words; null while it is tried")
    trace: list[list[float]] = Field(
        description="Where what counts was, each second: time (s), and x, y, z (units)"
    )


class SessionView(BaseModel):
    """A session and what stands on its workbench."""

    job: JobView
    open: bool = Field(description="Whether it takes calls")
    machines: list[BenchMachineView] = Field(
        description="What was built so far; the one that is simulated is the assembly, or the only"
    )
    tools: list[ToolView]
    limits: LimitsView
    calls: int = Field(description="Calls made so far")
    bytes: int = Field(description="Bytes of all arguments and answers so far")
    tests: list[TestTrialView] = Field(description="Its test trials so far, in order")
    most_tests: int = Field(description="Test trials that it may have; 0 for most tasks")


class ToolCall(BaseModel):
    """One action."""

    model_config = ConfigDict(extra="forbid")

    tool: Annotated[str, Field(max_length=100)]
    arguments: Any = Field(default={}, description="What the tool's parameters ask for")
    machine: MachineName = Field(
        default=MAIN,
        description=f"Sub-structure it is meant for; {ASSEMBLY!r} is put together from the others",
    )


class ToolOutcome(BaseModel):
    """What came of an action."""

    model_config = ConfigDict(from_attributes=True)

    ok: bool
    reason: str | None = Field(description="Refusal class, if it was refused")
    feedback: str = Field(description="The state in words, or what would have been allowed")


@router.post(
    "",
    status_code=201,
    responses={
        200: {"model": SessionOpened, "description": "It was open already"},
        **problem_responses(403, 422, 503),
    },
)
def open_session(
    body: OpenSession,
    response: Response,
    services: ServicesDep,
    caller: CallerDep,
) -> SessionOpened:
    """Opens a session in which an agent of yours, or you yourself, build for one task.

    The same name, kind, task, seed, simulator, worlds and data sheets give the same session for as
    long as it is open.
    """
    opened = services.external.open(
        task=body.task,
        agent=body.agent,
        seed=body.seed,
        simulator=body.simulator,
        kind=body.kind,
        owner=caller.key_id,
        force=caller.is_admin,
        data_sheets=body.data_sheets,
        worlds=body.worlds,
    )
    response.headers["Location"] = f"/v1/jobs/{opened.job.id}"
    if opened.reopened:
        response.status_code = 200
    return SessionOpened(
        id=opened.job.id,
        briefing=opened.briefing,
        statement=opened.task.statement,
        limits=LimitsView.model_validate(LIMITS),
        calls=opened.job.actions,
        tools=_tools(
            on_demand=opened.task.constraints.on_demand, programs=opened.task.takes_programs
        ),
    )


@router.get("/{session_id}", responses=problem_responses(404, 503))
def show_session(session_id: str, services: ServicesDep) -> SessionView:
    """Shows a session: its machines with every part's faces, its tools, and how much is left.

    Whoever builds by hand sees by it where something can be attached. What came of each call is in
    the job's transcript.
    """
    state = services.external.view(session_id)
    return SessionView(
        job=JobView.of(state.job),
        open=state.open,
        machines=[machine_view(name, machine) for name, machine in state.machines.items()],
        tools=_tools(
            on_demand=bool(state.job.track_config.get("looked_up")), programs=state.programs
        ),
        limits=LimitsView.model_validate(LIMITS),
        calls=state.calls,
        bytes=state.size,
        tests=[TestTrialView.model_validate(test) for test in state.tests],
        most_tests=state.most_tests,
    )


@router.get("/{session_id}/machine", responses=problem_responses(404, 409, 503))
def session_machine(session_id: str, services: ServicesDep) -> dict[str, Any]:
    """The machine that a submission would try now, as a document: try it, and build on."""
    try:
        return (
            Workbench.holding(services.external.view(session_id).machines).submitted().to_document()
        )
    except NothingToSubmitError as error:
        raise ProblemError(409, str(error)) from error


@router.post("/{session_id}/calls", responses=problem_responses(404, 409, 422, 503))
def call_tool(
    session_id: str, body: ToolCall, services: ServicesDep, context: ContextDep, caller: CallerDep
) -> ToolOutcome:
    """Carries out one action; a refused one changes nothing."""
    _require_own(session_id, context, caller)
    try:
        done = services.external.call(
            session_id, machine=body.machine, tool=body.tool, arguments=body.arguments
        )
    except SessionClosedError as error:
        raise ProblemError(409, str(error)) from error
    return ToolOutcome.model_validate(done)


@router.post("/{session_id}/tests", status_code=202, responses=problem_responses(404, 409, 503))
def test_session(
    session_id: str, services: ServicesDep, context: ContextDep, caller: CallerDep
) -> JobView:
    """Has the machine tried as it stands, where the task has test trials; the session goes on then.

    What was measured stands in the session (`tests`) once it is open again. It counts for nothing.
    """
    _require_own(session_id, context, caller)
    try:
        return JobView.of(services.external.test(session_id))
    except (SessionClosedError, NothingToSubmitError, NoTestError) as error:
        raise ProblemError(409, str(error)) from error


@router.post("/{session_id}/submit", status_code=202, responses=problem_responses(404, 409, 503))
def submit_session(
    session_id: str,
    response: Response,
    services: ServicesDep,
    context: ContextDep,
    caller: CallerDep,
) -> JobView:
    """Ends the session; the machine is simulated and scored."""
    _require_own(session_id, context, caller)
    try:
        job = services.external.submit(session_id)
    except (SessionClosedError, NothingToSubmitError) as error:
        raise ProblemError(409, str(error)) from error
    response.headers["Location"] = f"/v1/jobs/{job.id}"
    return JobView.of(job)


def _tools(*, on_demand: bool, programs: bool) -> list[ToolView]:
    return [
        ToolView.model_validate(tool.as_document())
        for tool in building_tools(on_demand=on_demand, programs=programs)
    ]


def _require_own(session_id: str, context: Context, caller: Caller) -> None:
    """An agent plays its own session only. An unknown one is for the sessions to refuse."""
    if caller.scope == "admin":
        return
    with contextlib.suppress(UnknownIdError):
        caller.require_owner(context.store.jobs.get(session_id).owner, f"session {session_id}")
