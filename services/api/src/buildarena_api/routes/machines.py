"""Routes of machines in files: checks, and trials of a task."""

from __future__ import annotations

from typing import Annotated, Any, Final

from fastapi import APIRouter, Depends, Query, Response

from buildarena_api.access import CallerDep, limited
from buildarena_api.dependencies import ContextDep, RequestKey
from buildarena_api.http.problems import unknown
from buildarena_api.machine_uploads import MAX_BYTES, read_uploaded, refused, uploaded
from buildarena_api.replays import KeyPress, Vector
from buildarena_api.scenes import MachineScene, machine_scene
from buildarena_api.schemas import EXISTED, JobView, View, tell_created
from buildarena_backend.agents.submission import request_trial
from buildarena_backend.catalog.specs import MAX_SEED, Name
from buildarena_backend.process.context import Context
from buildarena_benchmark import broken_constraint
from buildarena_geometry import Machine
from buildarena_simulation import DEFAULT_ENGINE

router = APIRouter(prefix="/v1/machines", tags=["machines"], dependencies=[limited("files")])

CHECK_PATH: Final = "/v1/machines/check"
TRIAL_PATH: Final = "/v1/machines/trials"
FILE: Final[dict[str, Any]] = {
    "requestBody": {
        "required": True,
        "description": "A machine document (JSON), or a machine file of the game (.bsg)",
        "content": {
            "application/octet-stream": {
                "schema": {"type": "string", "format": "binary", "maxLength": MAX_BYTES}
            }
        },
    }
}


FileDep = Annotated[bytes, Depends(uploaded)]
TaskName = Annotated[Name | None, Query(description="Also hold it against this task's rules")]


class MachineCheckView(View):
    """Content of a machine file and its faults."""

    name: str
    """The machine's name in the file; "" without one."""
    faults: list[str]
    """Reason why it cannot be tried."""
    broken_rule: str | None
    """The rule of the task that it breaks, if any."""
    remarks: list[str]
    """Parts of the file that are left out or unknown."""
    detached: list[str]
    """Blocks without a path to the starting block."""
    parts: int
    """Blocks and connectors."""
    mass: float
    """Mass units."""
    bounds: tuple[Vector, Vector] | None
    """Smallest and largest coordinates, units; null without blocks."""
    control_sequence: list[KeyPress]
    scene: MachineScene


@router.post("/check", response_model=MachineCheckView, openapi_extra=FILE)
def check_machine(data: FileDep, context: ContextDep, task: TaskName = None) -> Response:
    """Read a machine from a file and return its description and its faults.

    A file without a valid machine is refused with the reason.
    """
    upload = read_uploaded(data)
    content, machine = upload.content, upload.content.machine
    view = MachineCheckView.model_validate(
        {
            "name": content.name,
            "faults": [] if upload.fault is None else [upload.fault],
            "broken_rule": None if task is None else _broken_rule(context, machine, task),
            "remarks": list(content.not_understood),
            "detached": list(machine.detached),
            "parts": machine.part_count,
            "mass": machine.mass,
            "bounds": machine.bounds.tolist() if machine.started else None,
            "control_sequence": machine.control_sequence,
            "scene": machine_scene(machine),
        }
    )
    return Response(view.model_dump_json(), media_type="application/json")


@router.post("/trials", status_code=201, responses=EXISTED, openapi_extra=FILE)
def try_file(
    data: FileDep,
    *,
    task: Annotated[Name, Query(description="Whose trial")],
    simulator: Annotated[Name, Query()] = DEFAULT_ENGINE,
    seed: Annotated[int, Query(ge=0, le=MAX_SEED)] = 0,
    context: ContextDep,
    caller: CallerDep,
    response: Response,
    _: RequestKey,
) -> JobView:
    """Put a machine from a file through a task's trial, on no leaderboard.

    The same machine, task, simulator and seed give the same job; its score, trajectory and scene
    are those of any job.
    """
    upload = read_uploaded(data)
    if upload.fault is not None:
        raise refused(upload.fault)
    job, fresh = request_trial(
        context,
        upload.content.machine,
        task=task,
        simulator=simulator,
        seed=seed,
        owner=caller.key_id,
    )
    tell_created(response, f"/v1/jobs/{job.id}", is_new=fresh)
    return JobView.model_validate(job)


def _broken_rule(context: Context, machine: Machine, name: str) -> str | None:
    task = context.tasks.select([name]).get(name)
    if task is None:
        raise unknown("task", name, sorted(context.tasks.newest()))
    broken = broken_constraint(task, machine)
    return None if broken is None else broken[1]
