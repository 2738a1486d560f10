"""Our workflow of five roles, played by Inspect's models."""

from __future__ import annotations

from inspect_ai.solver import Generate, Solver, TaskState, solver


@solver
def five_roles() -> Solver:
    """The workflow of the benchmark: planner, drafter and reviewer, builder and guidance."""

    async def solve(state: TaskState, generate: Generate) -> TaskState:
        raise NotImplementedError

    return solve
