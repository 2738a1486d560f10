"""Briefing of a builder that works alone: the task, the rules and the modules.

A task's statement is written once, for models in workflows. What differs for a builder that brings
its own loop (it writes its own key presses) is added around it.
"""

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
        "You write the key presses before you submit: bind keys to actions with "
        "`change_control_key` and add presses with `add_control_sequence`, on the machine that is "
        "simulated."
    ),
    "constant": "Bind no keys: every water cannon fires from t = {from_s:g} s on.",
    "none": "Bind no keys: no key is pressed in this trial.",
}

_PROGRAMS: Final = (
    "A program may control the machine in place of key presses: set it with `set_controller` "
    "before you submit; `test_controller` shows what it would do. {contract}\n\n"
    "Without a program, key presses are played: bind keys with `change_control_key`, add presses "
    "with `add_control_sequence`."
)

_GIVEN: Final = (
    "`{main}` already contains a machine with keys and key presses: inspect it, then change it."
)
"""Control of a task with a given machine; its statement has the rest."""

_CHECKS: Final = {
    "always": (
        "More than the starting block, all parts joined. At most {own} blocks per sub-structure, "
        "{all} in total."
    ),
    "modules": "Only the modules below.",
    "exactly": "Exactly {count} x {name}.",
    "least": "At least {count} x {name}.",
    "most": "At most {count} x {name}.",
    "wheels": "At least {count} powered wheels.",
}

_ON_DEMAND: Final = "Only the modules that can be looked up."

_SINGLE: Final = "Exactly one."
_SEVERAL: Final = (
    "{count}. `machine` names the sub-structure of a call (default `{main}`); a new name begins a "
    "new one. To join several, call `add_machine` on the machine `{assembly}` with a "
    "sub-structure's name as `machine_id`, once for each copy, and connect the copies' faces. The "
    "first call on `{assembly}` copies the sub-structures: later changes to them do not affect it. "
    "An assembly keeps their key bindings and has its own key presses. Without an assembly the "
    "single sub-structure is submitted."
)


def briefing(
    task: Task,
    *,
    trials: str,
    guidelines: str,
    values: Mapping[str, str],
    data_sheets: bool = True,
) -> str:
    """Return everything that a builder needs to play a task, except its tools.

    Args:
        trials: The limit on submissions, in a sentence or two.
        guidelines: Template of the rules for calls and for the end, as paragraphs.
        values: Values of the names in `guidelines`, in addition to those of every task.
        data_sheets: Whether it contains the numbers of modules and world.

    Returns:
        Markdown: how it plays, the statement, the frame, the rules, the modules.
    """
    return Template(_text(trials, guidelines)).substitute(
        task=task.name,
        control=_control(task),
        statement=task.statement.strip(),
        sub_structures=_sub_structures(task),
        checks=_checks(task),
        modules=describe_modules(task, data_sheets=data_sheets),
        **values,
    )


def describe_trials(task: Task, rounds: int) -> str:
    """Return how often a builder may submit, in a sentence or two."""
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


def describe_worlds(worlds: int) -> str:
    """Return the paragraph on the varied worlds in which the machine is scored."""
    if not worlds:
        return ""
    return (
        f"**Worlds.** The machine is also tried in {counted(worlds, 'further world')}, drawn "
        f"afterwards. There it starts shifted by up to {START_SHIFT:g} to any side, up to "
        f"{START_DROP:g} higher, turned by up to {START_YAW_DEG:g}°; a cargo starts up to "
        f"{CARGO_SHIFT:g} to any side; each key press begins and ends up to "
        f"{KEY_DELAY_S:g} s late. The score is the mean over these worlds, where a failure counts "
        "0: leave some margin."
    )


def describe_modules(task: Task, *, data_sheets: bool) -> str:
    """Return the text on a task's modules: all of them, or how to look them up.

    Args:
        data_sheets: Whether modules have their data with them, and the world's follow.
    """
    constraints = task.constraints
    catalogue = visible_catalogue(constraints, data_sheets=data_sheets)
    names = modules_named(constraints.modules)
    text = lookup_text(catalogue) if constraints.on_demand else modules_text(catalogue, names)
    if not data_sheets:
        return text
    return f"{text}\n\n**World.** {world_text(catalogue, names, task)}"


def visible_catalogue(constraints: Constraints, *, data_sheets: bool) -> Catalogue:
    """Return the modules of a task as its builders may look them up: with or without their data."""
    catalogue = constraints.catalogue
    return catalogue.with_data_sheets if data_sheets else catalogue


@cache
def briefing_digest(
    trials: str, guidelines: str, *, on_demand: bool = False, data_sheets: bool = True
) -> str:
    """Return a hash of the words around a statement: results of different ones don't compare.

    Args:
        on_demand: Whether modules are looked up: such results do not compare with others.
        data_sheets: Whether the briefing contains the numbers of modules and world.
    """
    parts = [_text(trials, guidelines), *_CONTROL.values(), *_CHECKS.values(), _PROGRAMS]
    parts += [_SINGLE, _SEVERAL]
    parts += [file_text(name) for name in ("controller.md", "senses.json")]
    if on_demand:
        parts.append(_ON_DEMAND)
    if data_sheets:
        catalogue = module_set("workshop").with_data_sheets
        parts += [modules_text(catalogue), world_text(catalogue, modules_named("workshop"))]
    return sha256("\0".join(parts).encode()).hexdigest()


@cache
def _text(trials: str, guidelines: str) -> str:
    frame = file_text("briefing.md")
    return frame.replace("$trials", trials).replace("$guidelines", guidelines.strip()) + "\n"


def _control(task: Task) -> str:
    if task.initial_machine is not None:
        return _GIVEN.format(main=MAIN)
    if task.takes_programs:
        return _PROGRAMS.format(contract=describe_programs(task))
    return _CONTROL[task.control].format(from_s=task.scenario.control.from_s)


def describe_programs(task: Task) -> str:
    """Return the senses and commands of a program, in a task that takes programs."""
    senses = task.scenario.senses
    assert senses is not None  # noqa: S101 - it takes programs
    kinds = json.loads(file_text("senses.json"))
    lines = [f"- {kinds[kind]}" for kind in kinds if kind in senses.offers]
    accuracy = []
    if senses.delay_ticks:
        accuracy.append(f"Senses are {senses.delay_ticks * TICK_S:g} s old.")
    noise = ", ".join(f"{kind} {sigma:g}" for kind, sigma in senses.noise.items() if sigma)
    if noise:
        accuracy.append(f"Noise (standard deviations): {noise}.")
    return Template(file_text("controller.md")).substitute(
        senses="\n".join(lines), accuracy=" ".join(accuracy)
    )


@cache
def file_text(name: str) -> str:
    """Return the text of a file of this package, without blanks around it."""
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8").strip()


def _sub_structures(task: Task) -> str:
    fewest, maximum = task.constraints.min_sub_structures, task.constraints.max_sub_structures
    if maximum == 1:
        return _SINGLE
    count = f"Exactly {maximum}" if fewest == maximum else f"{fewest} to {maximum}"
    return _SEVERAL.format(count=count, main=MAIN, assembly=ASSEMBLY)


def _checks(task: Task) -> str:
    limits = task.constraints
    checks = [_CHECKS["always"].format(own=limits.max_blocks, all=limits.most_blocks)]
    if limits.modules is not None:
        checks.append(_ON_DEMAND if limits.on_demand else _CHECKS["modules"])
    for name in limits.min_modules | limits.max_modules:
        least, most = limits.min_modules.get(name), limits.max_modules.get(name)
        bounds = {"exactly": least} if least == most else {"least": least, "most": most}
        checks += [
            _CHECKS[kind].format(count=n, name=name) for kind, n in bounds.items() if n is not None
        ]
    if limits.min_wheels:
        checks.append(_CHECKS["wheels"].format(count=limits.min_wheels))
    return " ".join(checks)
