"""The analyst, which examines a failed round with read-only tools and advises the next one."""

from buildarena_geometry import kernels  # noqa: F401 - before numpy

# isort: split

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_backend.journal.transcript import Turn
from buildarena_benchmark.environment.tools import refuse_malformed
from buildarena_geometry import Accepted, Machine, Outcome, ToolDefinition, object_schema
from buildarena_simulation import Trajectory
from buildarena_worker.session.dialogue import Act, Dialogue, Role
from buildarena_worker.session.session import Session
from buildarena_worker.workflow.machine_tools import QUERIES, tools_named

ANALYST_TURNS = 20
ROWS = 60
"""Maximum number of rows that a call for transcript or trajectory returns."""

TRANSCRIPT = ToolDefinition(
    name="read_transcript",
    description=f"Read turns of the session, at most {ROWS} from the given one on.",
    parameters=object_schema({"first_turn": {"type": "integer", "minimum": 0}}, ["first_turn"]),
)
TRAJECTORY = ToolDefinition(
    name="read_trajectory",
    description=(
        "Read positions over time (seconds; x east, y north, z up) of a block, or of the cargo "
        f"with block 'cargo'; at most {ROWS} rows."
    ),
    parameters=object_schema(
        {
            "block": {"type": "string"},
            "from_s": {"type": "number", "minimum": 0},
            "to_s": {"type": "number", "minimum": 0},
        },
        ["block", "from_s", "to_s"],
    ),
)
BREAKS = ToolDefinition(
    name="read_breaks",
    description="Read which joints broke in the trial, and when.",
    parameters=object_schema({}),
)


LOOKS = {tool.name: tool for tool in (TRANSCRIPT, TRAJECTORY, BREAKS)}


def analyse(
    session: Session, machine: Machine, record: RolloutRecord, *, number: int, result: str
) -> str:
    """Let the analyst examine a round until it advises.

    Args:
        machine: The failed round's machine.
        record: The failed round's rollout.
        result: Description of the rollout's result.

    Returns:
        The advice, or the last text if the turns are used up.
    """
    opening = session.say("analyse", statement=session.statement, round=str(number), result=result)
    dialogue = Dialogue(session, phase="analyse", opening=opening)
    role = Role(
        name="analyst",
        system=session.pack.roles["analyst"],
        tools=[*tools_named(QUERIES), *LOOKS.values()],
        act=_make_act(session, machine, record),
    )
    text = ""
    for _ in range(ANALYST_TURNS):
        reply = dialogue.turn(role)
        text = reply.text or text
        if not reply.calls:
            break
    return text


def _make_act(session: Session, machine: Machine, record: RolloutRecord) -> Act:
    trajectory = session.host.trajectory(record)
    turns = list(session.transcript.turns)
    readers: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
        TRANSCRIPT.name: lambda arguments: _turns(turns, arguments),
        TRAJECTORY.name: lambda arguments: _positions(trajectory, arguments),
        BREAKS.name: lambda _: _breaks(trajectory),
    }

    def act(name: str, arguments: Any) -> Outcome:
        if name not in readers:
            return machine.act(name, arguments)
        refusal = refuse_malformed(LOOKS[name], arguments)
        if refusal is not None:
            return refusal
        text = readers[name](arguments or {})
        return Accepted(changed=(), render=lambda: text)

    return act


def _turns(turns: list[Turn], arguments: Mapping[str, Any]) -> str:
    first = arguments["first_turn"]
    lines = []
    for turn in turns[first : first + ROWS]:
        text = turn.text.replace("\n", " ")[:300]
        lines.append(f"{turn.index} [{turn.role}] {text}")
        lines += [f"  {a.name}({a.arguments}): {a.feedback[:300]}" for a in turn.actions]
    return "\n".join(lines) or f"There are {len(turns)} turns."


def _positions(trajectory: Trajectory | None, arguments: Mapping[str, Any]) -> str:
    if trajectory is None:
        return "There is no trajectory: the machine could not be simulated."
    block, start, end = arguments["block"], arguments["from_s"], arguments["to_s"]
    if block == "cargo" and trajectory.cargo_position is not None:
        points = trajectory.cargo_position
    elif block in trajectory.block_ids:
        points = trajectory.positions[:, trajectory.block_ids.index(block)]
    else:
        choices = ", ".join([*trajectory.block_ids[:ROWS], "cargo"])
        return f"There is no block {block!r}. There are: {choices}."
    times = np.asarray(trajectory.time_s)
    chosen = np.flatnonzero((times >= start) & (times <= end))
    step = max(1, -(-len(chosen) // ROWS))
    rows = [
        ", ".join(f"{float(value):.2f}" for value in (times[index], *points[index]))
        for index in chosen[::step]
    ]
    return "\n".join(rows) or f"The trial lasted from 0 to {times[-1]:g} s."


def _breaks(trajectory: Trajectory | None) -> str:
    if trajectory is None or not trajectory.breaks:
        return "No joint broke."
    return "\n".join(str(event) for event in trajectory.breaks[:ROWS])
