"""What a controller reads of a trial: where things were, and what its program sensed and did."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from buildarena_simulation import Piloting
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.controllers.pilot import named_in

STILL: Final = 0.02
"""Closer than this to where it ends, it has stopped, units."""
ROWS_PER_S: Final = 2
MAX_SENSES: Final = 24
MAX_ANSWERS: Final = 12


def rendered_trace(trace: Sequence[Sequence[float]]) -> str:
    """Rows of time and position; where nothing moves any more, one line says so.

    Args:
        trace: Rows of time, seconds, and x, y, z, units.
    """
    moving = len(trace)
    while moving > 1 and math.dist(trace[moving - 2][1:], trace[-1][1:]) < STILL:
        moving -= 1
    rows = [", ".join(f"{value:.2f}" for value in row) for row in trace[:moving]]
    if moving < len(trace):
        rows.append(f"It stays there until {trace[-1][0]:g} s.")
    return "\n".join(rows) or "(none)"


def rendered_piloting(piloting: Piloting, program: str) -> str:
    """A table of what a program sensed and asked for, twice a second.

    Of senses those are in it whose names the program has in its text, the first ones where they
    are many.

    Args:
        piloting: What it sensed and asked for.
        program: Its text.
    """
    named = named_in(program, piloting.sense_names)[:MAX_SENSES]
    senses = [piloting.sense_names.index(name) for name in named]
    heads = ["t", *named, *piloting.action_names[:MAX_ANSWERS]]
    rows = []
    ticks = len(piloting.answers) - 1
    for k in range(ticks):
        tick = round(k * SAMPLE_RATE_HZ / ROWS_PER_S)
        if tick >= ticks:
            break
        figures = [*piloting.senses[tick, senses], *piloting.answers[tick, :MAX_ANSWERS]]
        told = ", ".join(f"{value:.2f}" for value in figures)
        rows.append(f"{tick / SAMPLE_RATE_HZ:g}, {told}")
    return "\n".join([", ".join(heads), *rows])
