"""How a cargo lands in logs of the game that people published, and in our engines' trials.

The game's terrains are 4.5 high and its cargo is a little smaller than tasks say; trials have these
sizes here, so that heights can be compared.
"""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_simulation import Scenario, Trajectory
from buildarena_simulation.scenario import SpanPlacement, gap_terrain

LOGS: Final = Path(__file__).parents[1] / "data" / "besiege" / "game_logs"
BEGINS_S: Final = 0.065
"""When the game lets things fall, by its own clock; ours does at 0."""

TERRAIN: Final = 4.5
CARGO: Final = (2.28, 2.28, 1.45)
FALL_HEIGHT: Final = 4.0
"""Below it the published evaluation calls a cargo lost, units."""
_FALLS: Final = 0.2
"""How far something falls from one sample to the next, at least, before it lands, units."""
_RESTS: Final = 0.15
"""Above the height at the first contact, within which the second one is, units."""
_STOPS: Final = 4
"""Samples within which something that lands is lowest."""
_BOUNCES: Final = 0.1
"""A smaller rise is none, units."""

Floats = NDArray[np.float64]


def in_game(scenario: Scenario) -> Scenario:
    """A bridge's scenario with the sizes that the game's logs show."""
    placement, cargo = scenario.placement, scenario.cargo
    assert isinstance(placement, SpanPlacement)
    assert cargo is not None
    return scenario.model_copy(
        update={
            "terrain": gap_terrain(placement.gap, height=TERRAIN),
            "placement": SpanPlacement(gap=placement.gap, lowest_center=TERRAIN + 1.0),
            "cargo": cargo.model_copy(update={"size": CARGO}),
        }
    )


def cargo_path(trajectory: Trajectory, scenario: Scenario) -> tuple[Floats, Floats]:
    """Times by the game's clock, s, and heights of the cargo's underside, units, (T,) each."""
    assert trajectory.cargo_position is not None
    assert scenario.cargo is not None
    height = trajectory.cargo_position[:, 2].astype(np.float64) - scenario.cargo.size[2] / 2
    return trajectory.time_s + BEGINS_S, height


def logged(file: str) -> dict[str, float | None]:
    """The figures of a log: rows of time and height last, or of the published runner."""
    rows = [line.split(",") for line in (LOGS / file).read_text(encoding="ascii").splitlines()[1:]]
    named = [row for row in rows if not row[1].startswith("ID_") or len(row) == 5]
    column = {5: 3, 4: 2, 2: 1}[len(named[0])]
    path = np.array([(float(row[0]), float(row[column])) for row in named])
    return landing_figures(path[:, 0], path[:, 1], lost_below=FALL_HEIGHT)


def landing_figures(
    time_s: Floats, height: Floats, *, lost_below: float
) -> dict[str, float | None]:
    """When and where something lands, bounces, lands again and falls through.

    Args:
        time_s: (T,) seconds.
        height: (T,) units.
        lost_below: Below this height it fell through, units.

    Returns:
        Seconds and units; None for what does not happen.
    """
    steps = np.diff(height)
    lost = np.flatnonzero(height < lost_below)
    crossing = float(time_s[lost[0]]) if len(lost) else None
    carried = len(height) if crossing is None else int(lost[0])
    stopped = np.flatnonzero((steps[:-1] < -_FALLS) & (steps[1:] > 0.5 * steps[:-1])) + 1
    figures: dict[str, float | None] = dict.fromkeys(("contact_s", "peak", "peak_s", "again_s"))
    if len(stopped) and stopped[0] < carried:
        first = int(stopped[0])
        figures["contact_s"] = float(time_s[first])
        low = first + int(height[first : first + _STOPS].argmin())
        falls = np.flatnonzero(steps[low:] < 0)
        top = low + int(falls[0]) if len(falls) else len(height) - 1
        if height[top] - height[low] > _BOUNCES:
            back = np.flatnonzero(height[top:] < height[low] + _RESTS)
            figures |= {"peak": float(height[top]), "peak_s": float(time_s[top])}
            figures["again_s"] = float(time_s[top + back[0]]) if len(back) else None
    return {key: _two(value) for key, value in figures.items()} | {"crossing_s": _two(crossing)}


def _two(value: float | None) -> float | None:
    return None if value is None else round(value, 2)
