"""Sensible machines that nobody chose: drawn by a seed, for every built-in task.

Each is a plausible answer to its task, good or bad: a deck of any size with any bracing, a car of
any build and drive, a rocket of any engine and load, with a few blocks more wherever there is room.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np
from support.machines.building import attach, connect
from support.machines.families import beam, car, deck, rocket, rocket_assembly

from buildarena_benchmark.experts.drafting import BRACE, SIDES
from buildarena_geometry import Machine

Draw = np.random.Generator
_GAPS: Final = {"support-1": 5, "support-2": 10, "support-3": 20}
_KEYS: Final = ("UpArrow", "DownArrow", "LeftArrow", "RightArrow")


def random_machine(task: str, seed: int) -> Machine:
    """A machine for a task."""
    names = sorted(_DESIGNS)
    draw = np.random.default_rng([seed, names.index(task)])
    while True:
        try:
            return _DESIGNS[task](task, draw)
        except ValueError:  # parts of the design are in each other's way: drawn again
            continue


def _odd(draw: Draw, low: int, high: int) -> int:
    return int(draw.integers(low // 2, high // 2 + 1)) * 2 + 1


def _bridge(task: str, draw: Draw) -> Machine:
    gap = _GAPS[task]
    shortest = gap + 1 - gap % 2 + 2 * int(gap % 2)
    length = shortest + 2 * int(draw.integers(-1, 4))
    along = "".join(kind for kind in "tb12TB" if draw.random() < 0.25)
    if draw.random() < 0.3:
        return _with_extras(beam(length, along), draw)
    design = deck(
        _odd(draw, 3, 7),
        length,
        cross=bool(draw.random() < 0.5),
        along=along,
        rails=bool(draw.random() < 0.3),
    )
    return _with_extras(design, draw)


def _vehicle(task: str, draw: Draw) -> Machine:
    presses = []
    time_s = 0.5 + 3.0 * (task != "transport-1")
    for _ in range(int(draw.integers(1, 4))):
        hold_s = float(draw.uniform(0.3, 5.0))
        key = str(draw.choice(_KEYS, p=[0.6, 0.1, 0.15, 0.15]))
        presses.append((key, round(time_s, 2), round(hold_s, 2)))
        time_s += hold_s + float(draw.uniform(0.0, 1.0))
    half = {"transport-1": None, "transport-2": (2, 2), "transport-3": (2, 4)}[task]
    if half is not None:
        half = (half[0] + int(draw.integers(-1, 1)), half[1] + int(draw.integers(-1, 1)))
    design = car(
        _odd(draw, 5, 11),
        int(draw.integers(1, 4)),
        axles=int(draw.integers(2, 4)),
        deck_half=half,
        rails=bool(draw.random() < 0.6),
        drive=tuple(presses),
    )
    return _with_extras(design, draw)


def _rocket(task: str, draw: Draw) -> Machine:
    count = int(draw.integers(2, 5))
    if draw.random() < 0.7:
        sides = SIDES if count > 2 else SIDES[:2]
    else:
        sides = tuple(SIDES[k] for k in draw.permutation(4)[:count])
    heated = bool(draw.random() < 0.8)
    if task == "lift-3":
        return rocket_assembly(sides, heated=heated)
    design = rocket(
        sides,
        heated=heated,
        cargo_blocks=int(draw.integers(0, 8)),
        skew=bool(draw.random() < 0.15),
    )
    return _with_extras(design, draw, most=3 if task == "lift-1" else 0)


def _with_extras(machine: Machine, draw: Draw, most: int = 6) -> Machine:
    """A design with up to so many blocks and braces more, where the library allows them."""
    for _ in range(int(draw.integers(0, most + 1))):
        blocks = [b for b in machine.blocks.values() if b.module.kind in {"start", "block"}]
        first, second = (blocks[int(k)] for k in draw.integers(0, len(blocks), size=2))
        faces = [str(draw.choice([face.label for face in b.module.faces])) for b in (first, second)]
        if draw.random() < 0.7:
            attach(machine, first.id, faces[0])
        elif first.id != second.id:
            connect(machine, first.id, faces[0], second.id, faces[1], connector=BRACE)
    return machine


_DESIGNS: Final[Mapping[str, Callable[[str, Draw], Machine]]] = MappingProxyType(
    {
        **dict.fromkeys(_GAPS, _bridge),
        **dict.fromkeys(("transport-1", "transport-2", "transport-3"), _vehicle),
        **dict.fromkeys(("lift-1", "lift-2", "lift-3"), _rocket),
    }
)
TASKS: Final = tuple(sorted(_DESIGNS))
"""Names of the tasks machines are drawn for."""
