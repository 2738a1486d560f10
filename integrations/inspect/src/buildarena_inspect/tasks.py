"""Inspect's tasks, one for each of BuildArena's. `make generate NAME=inspect` writes this file."""

from typing import Unpack

from inspect_ai import Task, task

from buildarena_inspect.task_factory import TASK_NAMES, TaskArguments, task_of


@task
def transport_1(**arguments: Unpack[TaskArguments]) -> Task:
    """A vehicle that drives and steers."""
    return task_of("transport-1", **arguments)


@task
def transport_2(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that carries a 2.5 x 2.5 x 1.5 cargo."""
    return task_of("transport-2", **arguments)


@task
def transport_3(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that carries a 4 x 8 x 1.5 cargo there and back."""
    return task_of("transport-3", **arguments)


@task
def support_1(**arguments: Unpack[TaskArguments]) -> Task:
    """A bridge over a gap of 5."""
    return task_of("support-1", **arguments)


@task
def support_2(**arguments: Unpack[TaskArguments]) -> Task:
    """A bridge over a gap of 10."""
    return task_of("support-2", **arguments)


@task
def support_3(**arguments: Unpack[TaskArguments]) -> Task:
    """A bridge over a gap of 20."""
    return task_of("support-3", **arguments)


@task
def lift_1(**arguments: Unpack[TaskArguments]) -> Task:
    """A rocket engine."""
    return task_of("lift-1", **arguments)


@task
def lift_2(**arguments: Unpack[TaskArguments]) -> Task:
    """A rocket."""
    return task_of("lift-2", **arguments)


@task
def lift_3(**arguments: Unpack[TaskArguments]) -> Task:
    """A rocket of engine and frame."""
    return task_of("lift-3", **arguments)


@task
def mechanisms_1(**arguments: Unpack[TaskArguments]) -> Task:
    """A vehicle for a rough road."""
    return task_of("mechanisms-1", **arguments)


@task
def mechanisms_2(**arguments: Unpack[TaskArguments]) -> Task:
    """A car that steers through a slalom."""
    return task_of("mechanisms-2", **arguments)


@task
def mechanisms_3(**arguments: Unpack[TaskArguments]) -> Task:
    """A winch of gears."""
    return task_of("mechanisms-3", **arguments)


@task
def mechanisms_4(**arguments: Unpack[TaskArguments]) -> Task:
    """An arm that moves a cargo over a wall."""
    return task_of("mechanisms-4", **arguments)


@task
def flight_1(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that hovers with a cargo."""
    return task_of("flight-1", **arguments)


@task
def flight_2(**arguments: Unpack[TaskArguments]) -> Task:
    """A glider."""
    return task_of("flight-2", **arguments)


@task
def support_4(**arguments: Unpack[TaskArguments]) -> Task:
    """A bridge over a gap of 30, for loads to 5,000."""
    return task_of("support-4", **arguments)


@task
def support_5(**arguments: Unpack[TaskArguments]) -> Task:
    """A bridge over a gap of 45, for loads to 5,000."""
    return task_of("support-5", **arguments)


@task
def mechanisms_5(**arguments: Unpack[TaskArguments]) -> Task:
    """A car that steers through a slalom of 12 gates."""
    return task_of("mechanisms-5", **arguments)


@task
def mechanisms_6(**arguments: Unpack[TaskArguments]) -> Task:
    """An arm that puts a cargo down to 0.3."""
    return task_of("mechanisms-6", **arguments)


@task
def transport_4(**arguments: Unpack[TaskArguments]) -> Task:
    """A vehicle that stops at three points."""
    return task_of("transport-4", **arguments)


@task
def flight_3(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that hovers at three heights."""
    return task_of("flight-3", **arguments)


@task
def lift_4(**arguments: Unpack[TaskArguments]) -> Task:
    """A rocket that takes up a payload."""
    return task_of("lift-4", **arguments)


@task
def mechanisms_7(**arguments: Unpack[TaskArguments]) -> Task:
    """A winch for a cargo that grows heavier."""
    return task_of("mechanisms-7", **arguments)


@task
def support_6(**arguments: Unpack[TaskArguments]) -> Task:
    """A bridge over a gap of 5, for loads to 10,000."""
    return task_of("support-6", **arguments)


@task
def support_7(**arguments: Unpack[TaskArguments]) -> Task:
    """A bridge over a gap of 10, for loads to 10,000."""
    return task_of("support-7", **arguments)


@task
def budget_1(**arguments: Unpack[TaskArguments]) -> Task:
    """The lightest bridge over a gap of 10 that carries 300."""
    return task_of("budget-1", **arguments)


@task
def repair_1(**arguments: Unpack[TaskArguments]) -> Task:
    """A car with three faults, and four edits to repair it."""
    return task_of("repair-1", **arguments)


@task
def identify_1(**arguments: Unpack[TaskArguments]) -> Task:
    """A cargo taken to a height in a world that is not told."""
    return task_of("identify-1", **arguments)


@task
def landing_1(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that lands softly on a mark."""
    return task_of("landing-1", **arguments)


@task
def landing_2(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that lands softly on a mark with little fuel."""
    return task_of("landing-2", **arguments)


@task
def slalom_2(**arguments: Unpack[TaskArguments]) -> Task:
    """A car that finds its way through eight gates."""
    return task_of("slalom-2", **arguments)


@task
def hover_3(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that keeps its place in gusts."""
    return task_of("hover-3", **arguments)


@task
def hover_4(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that follows a moving place."""
    return task_of("hover-4", **arguments)


@task
def balance_1(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that stands on two wheels."""
    return task_of("balance-1", **arguments)


@task
def balance_2(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that stands on two wheels when pushed."""
    return task_of("balance-2", **arguments)


@task
def walk_1(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that walks north."""
    return task_of("walk-1", **arguments)


@task
def walk_2(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that walks north, and round a corner."""
    return task_of("walk-2", **arguments)


@task
def place_2(**arguments: Unpack[TaskArguments]) -> Task:
    """An arm that puts a cargo wherever its mark is."""
    return task_of("place-2", **arguments)


@task
def line_1(**arguments: Unpack[TaskArguments]) -> Task:
    """A car that follows a line it sees from above."""
    return task_of("line-1", **arguments)


@task
def throw_1(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that throws a boulder far."""
    return task_of("throw-1", **arguments)


@task
def throw_2(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that throws a boulder out of a fence."""
    return task_of("throw-2", **arguments)


@task
def throw_3(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that throws a boulder into a ring wherever that lies."""
    return task_of("throw-3", **arguments)


@task
def throw_4(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that throws a boulder through a ring wherever that stands."""
    return task_of("throw-4", **arguments)


@task
def throw_5(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that throws a boulder through two rings wherever those stand."""
    return task_of("throw-5", **arguments)


@task
def orbit_1(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that flies three times round a planet."""
    return task_of("orbit-1", **arguments)


@task
def orbit_2(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that flies round a planet and comes back softly."""
    return task_of("orbit-2", **arguments)


@task
def deliver_1(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that delivers a ball."""
    return task_of("deliver-1", **arguments)


@task
def deliver_2(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that delivers a ball up a ramp."""
    return task_of("deliver-2", **arguments)


@task
def deliver_3(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that delivers a ball under a barrier."""
    return task_of("deliver-3", **arguments)


@task
def drive_1(**arguments: Unpack[TaskArguments]) -> Task:
    """A vehicle that drives up a quarter pipe."""
    return task_of("drive-1", **arguments)


@task
def drive_2(**arguments: Unpack[TaskArguments]) -> Task:
    """A vehicle that drives over half cylinders."""
    return task_of("drive-2", **arguments)


@task
def drive_3(**arguments: Unpack[TaskArguments]) -> Task:
    """A vehicle that drives through a gap and past a cone."""
    return task_of("drive-3", **arguments)


@task
def drive_4(**arguments: Unpack[TaskArguments]) -> Task:
    """A vehicle that follows a track of two bends."""
    return task_of("drive-4", **arguments)


@task
def fetch_1(**arguments: Unpack[TaskArguments]) -> Task:
    """A machine that fetches a weight out of a well."""
    return task_of("fetch-1", **arguments)


@task(name="all")
def all_tasks(**arguments: Unpack[TaskArguments]) -> Task:
    """All tasks, each a sample."""
    return task_of(*TASK_NAMES, **arguments)
