"""Trials of machines by the benchmark's tasks, and what is pressed in them."""

from dataclasses import replace
from typing import Any

from buildarena_benchmark import Score, Task, score
from buildarena_geometry import KeyPress, Machine
from buildarena_simulation import Trajectory, simulate
from buildarena_simulation.scenario import TerrainBox


def press(key: str, time: float, hold_for: float = 0.1) -> KeyPress:
    return KeyPress(time_s=time, key=key, hold_for_s=hold_for)


def changed(task: Task, **changes: Any) -> Task:
    """The task with changes of its scenario, for its scorer too."""
    return replace(task, scenario=task.scenario.model_copy(update=changes))


def trial(task: Task, machine: Machine, engine: str, **changes: Any) -> tuple[Score, Trajectory]:
    """A trial of the task, whose scenario has these changes."""
    scenario = task.scenario.model_copy(update=changes)
    trajectory = simulate(machine, scenario, engine)
    return score(task, machine, trajectory), trajectory


def gap_terrain(gap: float, height: float = 5.0) -> tuple[TerrainBox, ...]:
    """The southern and the northern terrain of Support's tasks, their edges a gap apart."""
    return tuple(
        TerrainBox(center=(0.0, side * (gap / 2 + 10.0), height / 2), size=(30.0, 20.0, height))
        for side in (-1.0, 1.0)
    )
