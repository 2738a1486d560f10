"""The expert's machines with their programs, and what they do when they no longer look."""

from collections.abc import Callable
from typing import Final

from buildarena_benchmark import Score, Task, score
from buildarena_benchmark.experts import expert_designs
from buildarena_geometry import Machine
from buildarena_simulation import ENGINES, simulate
from buildarena_simulation.controllers.program import Program

Answer = dict[str, float]
FASTER_FIRST: Final = tuple(reversed(ENGINES))
"""The engines: of a test with samples, those are its first variants."""


def experts_machine(task: Task, seed: int = 0) -> Machine:
    """The expert's machine for a task that takes programs."""
    design = expert_designs()[task.name](seed)
    machine = task.new_machine(task.constraints.catalogue)
    for tool, arguments in next(iter(design.parts.values())).actions:
        outcome = machine.act(tool, arguments)
        assert outcome.ok, outcome.text
    return machine.with_controller(design.program)


def scored(task: Task, machine: Machine, engine: str, seed: int | None) -> Score:
    return score(task, machine, simulate(machine, task.scenario, engine, seed=seed))


def listened(task: Task, machine: Machine, engine: str) -> tuple[Score, list[Answer]]:
    """A trial in the exact world, and what the program answered at each tick."""
    answers: list[Answer] = []
    answer = Program.answer

    def listening(program: Program, *tick: object) -> Answer:
        answers.append(answer(program, *tick))  # type: ignore[arg-type]
        return answers[-1]

    return _answering(listening, task, machine, engine, None), answers


def repeated(
    answers: list[Answer], task: Task, machine: Machine, engine: str, seed: int | None
) -> Score:
    """A trial in which the program answers as it did then, whatever it senses."""

    def repeating(program: Program, tick: int, *_: object) -> Answer:
        del program
        return answers[min(tick, len(answers) - 1)]

    return _answering(repeating, task, machine, engine, seed)


def _answering(
    answer: Callable[..., Answer], task: Task, machine: Machine, engine: str, seed: int | None
) -> Score:
    before = Program.answer
    Program.answer = answer  # type: ignore[method-assign]
    try:
        return scored(task, machine, engine, seed)
    finally:
        Program.answer = before  # type: ignore[method-assign]
