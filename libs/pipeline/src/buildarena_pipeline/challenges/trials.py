"""Checks and scores of packages of machines that are tried in our own physics."""

from __future__ import annotations

from typing import Final

from buildarena_benchmark import Task, broken_constraint, builtin_tasks, score
from buildarena_benchmark.flags import is_disqualified, meaning
from buildarena_besiege import MachineFileError
from buildarena_besiege.any_file import read_any_machine
from buildarena_geometry import Machine
from buildarena_geometry.errors import DocumentError
from buildarena_pipeline.challenges.findings import CheckFailed
from buildarena_pipeline.challenges.scores import FULL, Term
from buildarena_simulation import DEFAULT_ENGINE, simulate

_DECIMALS: Final = 3


def task_named(name: str) -> Task:
    """A task of a season.

    Raises:
        CheckFailed: There is no such task.
    """
    task = builtin_tasks().get(name)
    if task is None:
        raise CheckFailed(f"the season's task {name} is none of the built-in ones")
    return task


def read_machine(data: bytes, name: str) -> Machine:
    """The machine of one of the package's files: a document, an action log or the game's file.

    Raises:
        CheckFailed: It is none, or an action of it is refused.
    """
    try:
        return read_any_machine(data, where=name).machine
    except (DocumentError, MachineFileError, ValueError) as error:
        raise CheckFailed(str(error) if str(error).startswith(name) else f"{name}: {error}") from (
            error
        )


def require_playable(machine: Machine, task: Task, name: str) -> None:
    """A machine is in one piece and keeps its task's constraints.

    Raises:
        CheckFailed: It does not.
    """
    if machine.detached:
        raise CheckFailed(f"{name}: block {machine.detached[0]} is attached to nothing")
    broken = broken_constraint(task, machine)
    if broken is not None:
        raise CheckFailed(f"{name}: {broken[1]}")


def require_modules(machine: Machine, allowed: frozenset[str], name: str) -> None:
    """A machine is made of the season's modules.

    Raises:
        CheckFailed: It is not; the message names the block.
    """
    for part in machine.state.parts:
        if part.module.name not in allowed:
            raise CheckFailed(
                f"{name}: {part.id}, a {part.module.name}, is no module of the season"
            )


def term_of(machine: Machine, task: Task, *, full: float, points: float) -> Term:
    """What a machine's trial in the task's exact world gives.

    Args:
        machine: The machine.
        task: The task.
        full: The indicator at which the share is full.
        points: What it gives at most.
    """
    result = score(task, machine, simulate(machine, task.scenario, DEFAULT_ENGINE))
    counts = result.success and not is_disqualified(result.flags)
    said = f"{result.indicator:.4g} of {full:g}" if counts else "the trial failed"
    if result.flags:
        said += "; " + "; ".join(meaning(flag) or flag for flag in result.flags)
    share = min(1.0, result.indicator / full) if counts else 0.0
    return Term(name=task.name, points=points, share=share, sentence=said)


def points_of(count: int) -> float:
    """What each of so many tasks gives at most."""
    return FULL / count


def cost_of_machine(machine: Machine) -> int:
    """The sum of a machine's modules' prices in the game."""
    return sum(part.module.cost for part in machine.state.parts)


def shape_of(machine: Machine) -> list[list[object]]:
    """A machine's blocks and their places, in no order: near-copies have the same."""
    return sorted(
        [block.module.name, *(round(x, _DECIMALS) + 0.0 for x in block.world_from_block.xyz)]
        for block in machine.blocks.values()
    )
