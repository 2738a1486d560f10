"""Catapults that nobody chose, drawn by a seed for the tasks of throwing.

Each is the expert's with another shape, other parts here and there, parts more, twists that are a
little off, and a key that is pressed sooner or later.
"""

import math
from contextlib import suppress
from typing import Final

import numpy as np
from support.machines.random_workshop import add_parts, bind, starts_clear, varied

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.experts.drafting import Draft
from buildarena_benchmark.tasks.throwing import expert as throwers
from buildarena_geometry import Machine

TASKS: Final = ("throw-1", "throw-4")
"""Names of the tasks machines are drawn for: those of key presses."""

_HUB, _TIP = 0.5, 0.75
"""Heights of the arm's root above the post's foot and of its tip's middle, units."""


def random_thrower(task: str, seed: int) -> Machine:
    """A catapult for a task, its keys bound and its presses written."""
    draw = np.random.default_rng([seed, TASKS.index(task)])
    while True:
        machine = _drawn(task, draw)
        if starts_clear(task, machine):
            return machine


def _drawn(task: str, draw: np.random.Generator) -> Machine:
    draft, springs, _ = _with_room(draw)
    machine = Machine(catalogue=builtin_tasks()[task].constraints.catalogue)
    for name, arguments in draft.actions:
        # Where another part has no room the design's own stands: later actions count on its number.
        if not machine.act(name, varied(name, arguments, draw)).ok:
            machine.act(name, arguments)
    add_parts(machine, draw)
    bound = [{"block": spring, "action": "contract", "keys": ["Alpha1"]} for spring in springs]
    press = {"time": 1.7, "key": "Alpha1", "hold_for": 4.0}
    bind(machine, {"control_config": bound, "control_sequence": [press]}, draw)
    return machine


def _with_room(draw: np.random.Generator) -> tuple[Draft, list[str], str]:
    while True:
        with suppress(ValueError):  # the arm has no room between its feet
            return throwers.catapult_draft(_shape(draw))


def _shape(draw: np.random.Generator) -> throwers.Shape:
    arm, post = int(draw.integers(5, 8)), int(draw.integers(3, 6))
    steep = math.degrees(math.asin(min((post + _HUB - _TIP) / arm, 0.9)))
    return throwers.Shape(
        arm=arm,
        post=post,
        tail=int(draw.integers(3, 5)),
        back=int(draw.integers(6, 10)),
        lean_deg=steep - float(draw.uniform(0, 3)),
        cup_deg=float(draw.uniform(0, 20)),
        springs=int(draw.integers(3, 8)),
    )
