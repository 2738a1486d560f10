"""Programs of genomes: changed in a place, taken apart, or written anew without a look."""

import re
from typing import Final

import numpy as np

from buildarena_geometry import Machine

IDLE: Final = "function control() return {} end"
_NUMBER: Final = re.compile(r"(?<![\w.\"])\d+(?:\.\d+)?(?![\w.\"])")
_FACTORS: Final = (0.0, 0.5, 0.9, 1.1, 2.0, 10.0)
_SWAPS: Final = (("<", ">"), (">", "<"), ("+", "-"), ("-", "+"), ("min", "max"), ("max", "min"))
_SHARES: Final = (-1.0, -0.5, 0.25, 0.5, 0.75, 1.0)


def changed(program: str, machine: Machine, draw: np.random.Generator) -> str:
    """A program with one random change; it may be none that can be read any more.

    Args:
        program: Lua; "" for none.
        machine: The machine, whose actions a new program asks for.
        draw: What everything is drawn from.
    """
    kind = draw.random()
    if not program or kind < 0.2:
        return _written(machine, draw)
    if kind < 0.7:
        return _renumbered(program, draw)
    if kind < 0.85:
        return _swapped(program, draw)
    lines = program.splitlines()
    at = int(draw.integers(len(lines)))
    return "\n".join([*lines[:at], *lines[at + 1 :]])


def _renumbered(program: str, draw: np.random.Generator) -> str:
    found = list(_NUMBER.finditer(program))
    if not found:
        return program
    number = found[int(draw.integers(len(found)))]
    value = float(number[0]) * float(draw.choice(_FACTORS))
    return f"{program[: number.start()]}{value:.6g}{program[number.end() :]}"


def _swapped(program: str, draw: np.random.Generator) -> str:
    word, other = _SWAPS[int(draw.integers(len(_SWAPS)))]
    places = [match.start() for match in re.finditer(re.escape(word), program)]
    if not places:
        return program
    at = places[int(draw.integers(len(places)))]
    return program[:at] + other + program[at + len(word) :]


def _written(machine: Machine, draw: np.random.Generator) -> str:
    """Some actions all the time, or from one instant to another, whatever is sensed."""
    actions = sorted({a for block in machine.blocks.values() for a in block.module.actions})
    if not actions:
        return IDLE
    chosen = [str(draw.choice(actions)) for _ in range(int(draw.integers(1, 4)))]
    asked = ", ".join(f"{action} = {draw.choice(_SHARES)}" for action in dict.fromkeys(chosen))
    start, length = draw.uniform(0.0, 10.0), draw.uniform(0.2, 20.0)
    when = "true" if draw.random() < 0.5 else f"t > {start:.2f} and t < {start + length:.2f}"
    return f"function control(t)\n  if {when} then return {{ {asked} }} end\n  return {{}}\nend"
