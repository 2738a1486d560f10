"""Sensible machines of the workshop that nobody chose, drawn by a seed for its six tasks.

Each is a design that answers its task, with other parts here and there, parts more, twists that are
a little off, and keys that are pressed sooner, later, longer or shorter.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from support.machines.building import attach

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.experts import expert_designs
from buildarena_geometry import Machine
from buildarena_simulation.clearance import require_clear_start
from buildarena_simulation.errors import MachineNotSimulable
from buildarena_simulation.machine import structure_of
from buildarena_simulation.placement import start_of

Draw = np.random.Generator

TASKS: Final = tuple(
    sorted(n for n, task in builtin_tasks().items() if task.category in ("mechanisms", "flight"))
)
"""Names of the tasks machines are drawn for."""

_STAND_INS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "Large Wheel": ("Powered Wheel",),
        "Suspension": ("Small Wooden Block", "Slider"),
        "Sqr Balloon": ("Balloon",),
        "Hinge": ("Swivel", "Ball Joint"),
        "Small Wooden Block": ("Ballast",),
        "Double Wooden Block": ("Wooden Pole",),
        "Log": ("Double Wooden Block",),
    }
)
_FURTHER: Final = (
    "Small Wooden Block",
    "Double Wooden Block",
    "Log",
    "Wooden Pole",
    "Corner Wooden Block",
    "Ballast",
    "Grip Pad",
    "Hinge",
    "Swivel",
    "Suspension",
    "Wheel Unpowered",
    "Wing Panel",
    "Balloon",
    "Drag Block",
)
_SWAPPED, _TWIST_DEG = 0.04, 4.0


def random_workshop_machine(task: str, seed: int) -> Machine:
    """A machine for a task of the workshop, its keys bound and its presses written."""
    draw = np.random.default_rng([seed, TASKS.index(task)])
    while True:
        machine = _drawn(task, draw)
        if starts_clear(task, machine):
            return machine


def starts_clear(task: str, machine: Machine) -> bool:
    """Whether nothing of it is where the trial puts the cargo or has its terrain."""
    scenario, structure = builtin_tasks()[task].scenario, structure_of(machine)
    try:
        require_clear_start(structure, scenario, start_of(structure, scenario, None))
    except MachineNotSimulable:
        return False
    return True


def _drawn(task: str, draw: Draw) -> Machine:
    design = expert_designs()[task](int(draw.integers(0, 1000)))
    machine = Machine(catalogue=builtin_tasks()[task].constraints.catalogue)
    (part,) = design.parts.values()
    for name, arguments in part.actions:
        # Where another part has no room the design's own stands: later actions count on its number.
        if not machine.act(name, varied(name, arguments, draw)).ok:
            machine.act(name, arguments)
    add_parts(machine, draw)
    bind(machine, design.control or {}, draw)
    return machine


def varied(name: str, arguments: Mapping[str, Any], draw: Draw) -> dict[str, Any]:
    varied = dict(arguments)
    if name == "attach_block_to" and draw.random() < _SWAPPED:
        varied["new_block"] = str(draw.choice(_STAND_INS.get(varied["new_block"], ("Hinge",))))
    if name == "twist_block" and draw.random() < 0.5:
        varied["angle"] = float(varied["angle"] + draw.uniform(-_TWIST_DEG, _TWIST_DEG))
    return varied


def add_parts(machine: Machine, draw: Draw) -> None:
    offered = [name for name in _FURTHER if name in machine.catalogue]
    for _ in range(int(draw.integers(0, 5))):
        blocks = [block for block in machine.blocks.values() if block.module.faces]
        base = blocks[int(draw.integers(0, len(blocks)))]
        face = str(draw.choice([face.label for face in base.module.faces]))
        module = str(draw.choice(offered))
        attach(machine, base.id, face, module)


def bind(machine: Machine, control: Mapping[str, Any], draw: Draw) -> None:
    for bound in control.get("control_config", ()):
        for key in bound["keys"]:
            told = {"block_id": bound["block"], "action": bound["action"], "new_key": key}
            machine.act("change_control_key", told)
    for press in control.get("control_sequence", ()):
        time_s = max(0.0, press["time"] + float(draw.uniform(-0.2, 0.2)))
        hold_s = press["hold_for"] * float(draw.uniform(0.9, 1.1))
        told = {"key": press["key"], "time": round(time_s, 2), "hold_for": round(hold_s, 2)}
        machine.act("add_control_sequence", told)
