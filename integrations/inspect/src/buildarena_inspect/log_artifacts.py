"""Additional content of a sample's log: the building, the trial, and its pictures."""

from __future__ import annotations

import base64
import tempfile
from pathlib import Path
from typing import Final

import anyio
from inspect_ai.model import ChatMessageUser, ContentImage, ContentText
from inspect_ai.solver import TaskState

from buildarena_benchmark.environment import Trial
from buildarena_benchmark.environment.trials.trials import score_text
from buildarena_geometry import Machine
from buildarena_inspect.building import CALLS, STATE, Building, building_of, end
from buildarena_inspect.errors import LogError
from buildarena_simulation import write_trajectory
from buildarena_simulation.render.film import write_film

MACHINE: Final = "buildarena:machine"
"""Key of the document of the counted trial's machine in a sample's store."""
TRAJECTORY: Final = "buildarena:trajectory"
"""Key of that trial's trajectory: Parquet, as base64."""
PICTURES: Final = "buildarena"
"""Key of the metadata of the message with the film strip."""


async def keep(state: TaskState) -> None:
    """Store the building of a sample that has ended in any way."""
    try:
        building = building_of(state)
    except LogError:
        return
    try:
        await _keep(state, building)
    finally:
        end(state)


async def _keep(state: TaskState, building: Building) -> None:
    state.store.set(STATE, building.environment.state().as_document())
    state.store.set(CALLS, building.calls)
    machine, trial = building.machine, building.trial
    if machine is None or trial is None:
        return
    state.store.set(MACHINE, machine.to_document())
    if trial.trajectory is None:
        return
    state.store.set(TRAJECTORY, base64.b64encode(write_trajectory(trial.trajectory)).decode())
    state.messages.append(await anyio.to_thread.run_sync(_film_message, building, machine, trial))


def _film_message(building: Building, machine: Machine, trial: Trial) -> ChatMessageUser:
    """Return six pictures of a trial, which are added after the last request to a model."""
    task = building.environment.task
    assert trial.trajectory is not None  # noqa: S101 - checked before
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trial.png"
        write_film(machine, task.scenario, trial.trajectory, path)
        image = base64.b64encode(path.read_bytes()).decode()
    return ChatMessageUser(
        content=[
            ContentText(
                text=f"Trial of {task.name}, for readers of this log. "
                + score_text(task, trial.score)
            ),
            ContentImage(image=f"data:image/png;base64,{image}"),
        ],
        metadata={PICTURES: "film"},
    )
