"""What a task allows: checked on the machine, not only asked for."""

from __future__ import annotations

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
    if constraints.max_blocks is not None and machine.part_count > constraints.max_blocks:
        return (
            "constraint_violated",
            f"the machine has {machine.part_count} parts, the task allows {constraints.max_blocks}",
        )
    used = {block.module.name for block in machine.blocks.values()}
    used |= {connector.module.name for connector in machine.connectors.values()}
    allowed = {*(constraints.modules or used), "Starting Block"}
    if not used <= allowed:
        return "constraint_violated", f"{min(used - allowed)} is not among the task's modules"
    return None
