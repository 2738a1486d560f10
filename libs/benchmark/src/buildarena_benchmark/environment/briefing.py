"""What one who builds alone reads first: the task, the rules and the modules.

A task's statement is written once, for models in workflows. What differs for a builder that brings
its own loop (it writes its own key presses) is said around it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from hashlib import sha256
from importlib import resources
from string import Template
from typing import Final

from buildarena_benchmark import Task
from buildarena_benchmark.environment.tools import ASSEMBLY, MAIN
from buildarena_benchmark.environment.trials.world import world_text
from buildarena_benchmark.tasks.document import Constraints
from buildarena_geometry import Catalogue, module_set, modules_named
from buildarena_geometry.feedback.modules import lookup_text, modules_text
from buildarena_geometry.feedback.words import counted
from buildarena_simulation.constants import (
    CARGO_SHIFT,
    KEY_DELAY_S,
    START_DROP,
    START_SHIFT,
    START_YAW_DEG,
)
from buildarena_simulation.controllers.senses import TICK_S

_CONTROL: Final = {
    "agent": (
        "You write the key presses yourself, before you submit: bind a key to each action that "
        "shall be used with `change_control_key`, and say when which key is held with "
        "`add_control_sequence`, both on the machine that is simulated. An assembly keeps the "
        "bindings of its sub-structures and has a sequence of its own."
    ),
    "held": "You need not bind any key: every water cannon fires from t = {from_s:g} s on.",
    "none": "No key is pressed in this trial, so you need not bind any.",
}

_PROGRAMS: Final = (
    "You may write a program that senses and acts in place of key presses: `set_controller`, on "
    "the machine that is simulated, before you submit; `test_controller` asks what it would do. "
    "{contract}\n\n"
    "Without a program, keys are played: `change_control_key` binds them, `add_control_sequence` "
    "presses them."
)

_GIVEN: Final = (
    "A machine stands in `{main}` already, with its keys and its key presses: your first call "
    "finds it there, and you change it."
)
"""What a task with a given machine says of control; its statement says the rest."""

_CHECKS: Final = {
    "always": (
        "There is more than the starting block. Joints that hold and connectors join every part to "
        "the first starting block. At most {own} blocks in a sub-structure, {all} in all."
    ),
    "modules": "Only the modules listed below.",
    "least": "At least {count} x {name}.",
    "wheels": "At least {count} powered wheels.",
}

_ON_DEMAND: Final = "Only the modules that can be looked up."


def briefing(
    task: Task,
    *,
    trials: str,
    guidelines: str,
    values: Mapping[str, str],
    data_sheets: bool = True,
) -> str:
    """All that a builder must know to play a task, but for its tools.

    Args:
        task: The task.
        trials: How often it may submit, in a sentence or two.
        guidelines: What holds for its calls and for the end, as paragraphs; a template.
        values: What stands in for the names in `guidelines`, beside those of every task.
        data_sheets: Whether it is told the numbers of modules and world.

    Returns:
        Markdown: how it plays, the statement, the frame, the rules, the modules.
    """
    return Template(_text(trials, guidelines)).substitute(
        task=task.name,
        control=_control(task),
        statement=task.statement.strip(),
        sub_structures=_sub_structures(task),
        main=MAIN,
        assembly=ASSEMBLY,
        checks=_checks(task),
        modules=modules_told(task, data_sheets=data_sheets),
        **values,
    )


def describe_trials(task: Task, rounds: int) -> str:
    """Return how often a builder may submit, in a sentence or two.

    Args:
        task: The task.
        rounds: Number of submissions.
    """
    if rounds == 1:
        return "Submit once; the machine has one trial."
    if task.test_trials:
        tests = describe_tests(task)
        return (
            f"Submit {rounds} times; each submission is a trial. {tests} Only the last one counts."
        )
    return f"Submit up to {rounds} times; each submission is a trial and the best one counts."


def describe_tests(task: Task) -> str:
    """Return which trials of a task are test trials, and in which worlds; "" without any."""
    if not task.test_trials:
        return ""
    count = counted(task.test_trials, "test trial")
    if task.test_seed(task.test_trials, 0) is None:
        return f"The first {count} do not count."
    return (
        f"The first {count} do not count; the last of them is in a world drawn for you alone, the "
        "others in the exact world."
    )


def worlds_told(worlds: int) -> str:
    """What a builder reads of the varied worlds that its machine is scored in.

    Args:
        worlds: How many; with 0 there is nothing to read.
    """
    if not worlds:
        return ""
    return (
        f"**Worlds.** What you finish is tried in {counted(worlds, 'further world')} too, drawn "
        f"afterwards: there it starts up to {START_SHIFT:g} to any side and up to {START_DROP:g} "
        f"higher, turned by up to {START_YAW_DEG:g}°, a cargo up to {CARGO_SHIFT:g} to any side, "
        f"and each key goes down and up by up to {KEY_DELAY_S:g} s late. Your score is the mean "
        "over them, where a failure counts 0: leave some margin."
    )


def modules_told(task: Task, *, data_sheets: bool) -> str:
    """What a builder reads about its modules: all of them, or how to look them up.

    Args:
        task: The task.
        data_sheets: Whether modules have their data with them, and the world's follow.
    """
    constraints = task.constraints
    catalogue = catalogue_told(constraints, data_sheets=data_sheets)
    names = modules_named(constraints.modules)
    told = lookup_text(catalogue) if constraints.on_demand else modules_text(catalogue, names)
    if not data_sheets:
        return told
    return f"{told}\n\n**World.** {world_text(catalogue, names, task)}"


def catalogue_told(constraints: Constraints, *, data_sheets: bool) -> Catalogue:
    """The modules of a task as its builders may look them up: with or without their data."""
    catalogue = constraints.catalogue
    return catalogue.with_data_sheets() if data_sheets else catalogue


@cache
def briefing_digest(
    trials: str, guidelines: str, *, on_demand: bool = False, data_sheets: bool = True
) -> str:
    """Hash of the words around a statement: results of different ones don't compare.

    Args:
        trials: How often it may submit.
        guidelines: What holds for its calls and for the end.
        on_demand: Whether modules are looked up: who does that does not compare with who is told.
        data_sheets: Whether it is told the numbers of modules and world.
    """
    words = [_text(trials, guidelines), *_CONTROL.values(), *_CHECKS.values(), _PROGRAMS]
    words += [file_text(name) for name in ("controller.md", "senses.json")]
    if on_demand:
        words.append(_ON_DEMAND)
    if data_sheets:
        told = module_set("workshop").with_data_sheets()
        words += [modules_text(told), world_text(told, modules_named("workshop"))]
    return sha256("\0".join(words).encode()).hexdigest()


@cache
def _text(trials: str, guidelines: str) -> str:
    frame = file_text("briefing.md")
    return frame.replace("$trials", trials).replace("$guidelines", guidelines.strip()) + "\n"


def _control(task: Task) -> str:
    if task.beginning is not None:
        return _GIVEN.format(main=MAIN)
    if task.takes_programs:
        return _PROGRAMS.format(contract=programs_told(task))
    return _CONTROL[task.control].format(from_s=task.scenario.control.from_s)


def programs_told(task: Task) -> str:
    """What a program is told and may answer, in a task that takes programs."""
    senses = task.scenario.senses
    assert senses is not None  # noqa: S101 - it takes programs
    kinds = json.loads(file_text("senses.json"))
    lines = [f"- {kinds[kind]}" for kind in kinds if kind in senses.offers]
    accuracy = []
    if senses.delay_ticks:
        accuracy.append(f"What you sense is {senses.delay_ticks * TICK_S:g} s old.")
    noise = ", ".join(f"{kind} {sigma:g}" for kind, sigma in senses.noise.items() if sigma)
    if noise:
        accuracy.append(f"Standard deviations of its noise: {noise}.")
    return Template(file_text("controller.md")).substitute(
        senses="\n".join(lines), accuracy=" ".join(accuracy)
    )


@cache
def file_text(name: str) -> str:
    """The text of a file of this package, without blanks around it."""
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8").strip()


def _sub_structures(task: Task) -> str:
    fewest, most = task.constraints.min_sub_structures, task.constraints.max_sub_structures
    if fewest == most:
        return f"exactly {counted(most, 'sub-structure')}"
    return f"{fewest} to {most} sub-structures"


def _checks(task: Task) -> str:
    limits = task.constraints
    checks = [_CHECKS["always"].format(own=limits.max_blocks, all=limits.most_blocks)]
    if limits.modules is not None:
        checks.append(_ON_DEMAND if limits.on_demand else _CHECKS["modules"])
    checks += [
        _CHECKS["least"].format(count=count, name=name)
        for name, count in limits.min_modules.items()
    ]
    if limits.min_wheels:
        checks.append(_CHECKS["wheels"].format(count=limits.min_wheels))
    return " ".join(checks)
