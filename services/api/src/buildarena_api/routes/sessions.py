"""Routes of external agents: open a session, call tools, submit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Response
from pydantic import AliasPath, BeforeValidator, Field

from buildarena_api.access import Caller, CallerDep, limited
from buildarena_api.dependencies import RequestKey, Services, ServicesDep
from buildarena_api.replays import KeyPress, PartView, Vector
from buildarena_api.schemas import EXISTED, Document, JobView, View, tell_created
from buildarena_backend.agents.briefing import SessionLimits
from buildarena_backend.agents.test_trials import TestTrial
from buildarena_backend.catalog.specs import Name, Seed, Worlds
from buildarena_benchmark.environment import ASSEMBLY, MAIN, Workbench
from buildarena_geometry import Block, Connector, Machine, ToolDefinition
from buildarena_geometry.feedback.words import caption
from buildarena_simulation import DEFAULT_ENGINE

router = APIRouter(prefix="/v1/sessions", tags=["sessions"], dependencies=[limited()])

MachineName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,40}$")]


class OpenSession(Document):
    """A request to build."""

    task: Name
    agent: Annotated[str, Field(max_length=80)]
    """Its name on the leaderboard, which belongs to the key that first uses it."""
    seed: Seed = 0
    simulator: Name = DEFAULT_ENGINE
    kind: Literal["agent", "human"] = "agent"
    """Kind of builder: a program, on leaderboards `agent/NAME`, or a person, `human/NAME`. A name
    has only one kind."""
    data_sheets: bool = True
    """Tell each module's data and the world's; sessions with and without are ranked apart."""
    worlds: Worlds = None


class ToolView(View):
    """A tool that the agent may call."""

    name: str
    description: str
    parameters: dict[str, Any]
    """JSON schema of its arguments."""


class FaceView(View):
    """A face of a block under construction."""

    label: str = Field(examples=["A"])
    side: str = Field(examples=["East"])
    """Its direction, in the words of feedback."""
    center: Vector
    """World frame, units."""
    normal: Vector
    """Outwards, world frame, unit length."""
    taken_by: str | None
    """The block that it touches by an attachment; null if it takes a block."""


class WorkbenchPart(PartView):
    """A part of a machine under construction."""

    sits_on: tuple[str, str] | None
    """Block and face that it is attached to; null for starting blocks, connectors and blocks whose
    base was removed."""
    ends: list[tuple[str, str]]
    """Block and face of a connector's two ends."""
    faces: list[FaceView]
    """Blocks: faces that can be built on."""
    actions: list[str]
    """Actions to which keys can be bound."""
    spins: bool
    """Whether its spin can be flipped."""


class SubStructureView(View):
    """A copy of a machine in an assembly."""

    letter: str
    source: str
    """The machine that it is a copy of."""


class WorkbenchMachine(View):
    """A machine under construction."""

    name: str
    parts: list[WorkbenchPart]
    control_sequence: list[KeyPress]
    controller: str
    """The program that acts in place of it, Lua; empty for none."""
    sub_structures: list[SubStructureView]
    """Assemblies only."""
    available: list[str]
    """Machines that an assembly can be put together from."""
    mass: float
    """Mass units."""
    detached: list[str]
    """Blocks without a path to the starting block."""


def _machines(machines: Mapping[str, Machine]) -> list[WorkbenchMachine]:
    """Return the machines under construction, each under its name on the workbench."""
    return [
        WorkbenchMachine.model_validate(
            {
                "name": name,
                "parts": [
                    *(_part(block, machine) for block in machine.blocks.values()),
                    *(_part(link, machine) for link in machine.connectors.values()),
                ],
                "control_sequence": machine.control_sequence,
                "controller": machine.controller,
                "sub_structures": list(machine.state.structures.values()),
                "available": list(machine.available),
                "mass": machine.mass,
                "detached": list(machine.detached),
            }
        )
        for name, machine in machines.items()
    ]


def _tools(tools: Sequence[ToolDefinition]) -> list[Mapping[str, Any]]:
    return [tool.as_document() for tool in tools]


def _part(part: Block | Connector, machine: Machine) -> WorkbenchPart:
    faces: list[FaceView] = []
    ends: list[tuple[str, str]] = []
    if isinstance(part, Block):
        faces = [_face(part, face.label, machine) for face in part.module.faces]
    else:
        ends = [part.start, part.end]
    return WorkbenchPart(
        **PartView.model_validate(part).model_dump(),
        sits_on=getattr(part, "mount", None),
        ends=ends,
        faces=faces,
        actions=list(part.module.actions),
        spins=part.module.spins,
    )


def _face(block: Block, label: str, machine: Machine) -> FaceView:
    state = machine.state
    normal = block.face_normal(label)
    taken_by = state.occupants.get((block.id, label))
    if taken_by is None and state.is_occupied(block, label):
        taken_by = None if block.mount is None else block.mount[0]
    return FaceView(
        label=label,
        side=caption(normal).strip("<>"),
        center=block.face_center(label),
        normal=normal,
        taken_by=taken_by,
    )


class SessionView(View):
    """A session and the machines on its workbench."""

    id: str = Field(validation_alias=AliasPath("job", "id"))
    """Also the id of the job that will hold the score."""
    job: JobView
    briefing: str
    """Instructions for an agent, as Markdown: how it plays, the statement, the frame, the rules,
    the modules with their data, and the world."""
    statement: str
    """The task's statement; part of the briefing."""
    open: bool
    """Whether it takes calls."""
    machines: Annotated[list[WorkbenchMachine], BeforeValidator(_machines)]
    """Machines built so far; the one that is simulated is the assembly, or the only one."""
    tools: Annotated[list[ToolView], BeforeValidator(_tools)]
    limits: SessionLimits
    calls: int
    """Calls made so far."""
    bytes: int = Field(validation_alias="size")
    """Bytes of all arguments and answers so far."""
    test_trials: list[TestTrial] = Field(validation_alias="tests")
    """Its test trials so far, in order."""
    max_test_trials: int
    """Test trials that it may have; 0 for most tasks."""


class ToolCall(Document):
    """An action."""

    tool: Annotated[str, Field(max_length=100)]
    arguments: Any = Field(default={})
    """Values of the tool's parameters."""
    machine: MachineName = Field(
        default=MAIN,
        description=f"Sub-structure it is meant for; {ASSEMBLY!r} is put together from the others",
    )


class ToolOutcome(View):
    """Result of an action."""

    ok: bool
    reason: str | None
    """Refusal class, if it was refused."""
    feedback: str
    """The state in words, or what would have been allowed."""


@router.post("", status_code=201, responses=EXISTED)
def open_session(
    body: OpenSession, response: Response, services: ServicesDep, caller: CallerDep, _: RequestKey
) -> SessionView:
    """Open a session in which an agent of yours, or you yourself, build for one task.

    The same name, kind, task, seed, simulator, worlds and data sheets give the same session for as
    long as it is open.
    """
    state, fresh = services.external.open(**dict(body), owner=caller.key_id, force=caller.is_admin)
    tell_created(response, f"/v1/sessions/{state.job.id}", is_new=fresh)
    return SessionView.model_validate(state)


@router.get("/{session_id}")
def show_session(session_id: str, services: ServicesDep) -> SessionView:
    """Return a session: its machines with every part's faces, its tools, and its remaining limits.

    It shows a person where something can be attached. The result of each call is in
    the job's transcript.
    """
    return SessionView.model_validate(services.external.view(session_id))


@router.get("/{session_id}/machine")
def session_machine(session_id: str, services: ServicesDep) -> dict[str, Any]:
    """Return the machine that a submission would try now, as a document: try it, and build on."""
    machines = services.external.view(session_id).machines
    return Workbench.holding(machines).submitted().to_document()


@router.post("/{session_id}/calls")
def call_tool(
    session_id: str, body: ToolCall, services: ServicesDep, caller: CallerDep
) -> ToolOutcome:
    """Carry out one action; a refused one changes nothing."""
    _require_own(session_id, services, caller)
    done = services.external.call(
        session_id, machine=body.machine, tool=body.tool, arguments=body.arguments
    )
    return ToolOutcome.model_validate(done)


@router.post("/{session_id}/test-trials")
def test_session(session_id: str, services: ServicesDep, caller: CallerDep) -> JobView:
    """Try the present machine, where the task has test trials; the session continues afterwards.

    The measurements are in the session (`tests`) once it is open again. They do not count.
    """
    _require_own(session_id, services, caller)
    return JobView.model_validate(services.external.test(session_id))


@router.post("/{session_id}/submit")
def submit_session(
    session_id: str, response: Response, services: ServicesDep, caller: CallerDep
) -> JobView:
    """End the session; the machine is simulated and scored."""
    _require_own(session_id, services, caller)
    job = services.external.submit(session_id)
    response.headers["Location"] = f"/v1/jobs/{job.id}"
    return JobView.model_validate(job)


def _require_own(session_id: str, services: Services, caller: Caller) -> None:
    """Check that the session is the agent's own."""
    caller.require_owner(services.external.job(session_id).owner, f"session {session_id}")
