"""What a task allows: checked on the machine, not only asked for."""

from __future__ import annotations

from collections import Counter

from buildarena_benchmark.tasks.task import Task
from buildarena_geometry import Machine


def broken_constraint(task: Task, machine: Machine) -> tuple[str, str] | None:
    """The first constraint of a task that a finished machine breaks.

    Args:
        task: The task.
        machine: What was built.

    Returns:
        Class and sentence, or None when the machine may be simulated.
    """
    constraints = task.constraints
    if not machine.started:
        return "empty_machine", "no machine was started"
    if len(machine.blocks) == 1 and not machine.connectors:
        return "empty_machine", "the machine is nothing but its starting block"
    crowded = _crowded(task, machine)
    if crowded is not None:
        return "constraint_violated", crowded
    used = Counter(block.module.name for block in machine.blocks.values())
    used.update(connector.module.name for connector in machine.connectors.values())
    if constraints.modules is not None:
        foreign = set(used) - {*constraints.modules, machine.catalogue.start.name}
        if foreign:
            return "constraint_violated", f"{min(foreign)} is not among the task's modules"
    for name, least in constraints.min_modules.items():
        if used[name] < least:
            return (
                "constraint_violated",
                f"the machine has {used[name]} of {name}, the task asks for {least} or more",
            )
    return None


def _crowded(task: Task, machine: Machine) -> str | None:
    """Which limit on blocks the machine or one of its sub-structures exceeds, if any."""
    limits = task.constraints
    if len(machine.blocks) > limits.most_blocks:
        return (
            f"the machine has {len(machine.blocks)} blocks, the task allows {limits.most_blocks} "
            "in all"
        )
    sizes = Counter(block.structure for block in machine.blocks.values())
    for letter, size in sizes.items():
        if size > limits.max_blocks:
            named = f"sub-structure {letter}" if letter else "the machine"
            return f"{named} has {size} blocks, the task allows {limits.max_blocks} in one"
    return None
