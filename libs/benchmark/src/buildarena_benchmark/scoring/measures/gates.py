"""Crossings of gates' lines by paths."""

import numpy as np

from buildarena_benchmark.scoring.measures.series import Series
from buildarena_simulation import Scenario
from buildarena_simulation.scenario import Gate


def unknown_gate(name: str, scenario: Scenario) -> str | None:
    """Return why no machine can cross a gate: the scenario lacks it; None if it has it."""
    names = [gate.name for gate in scenario.gates]
    return None if name in names else f"unknown gate {name!r}; gates: {', '.join(names) or 'none'}"


def gate_of(name: str, scenario: Scenario) -> Gate:
    """Return a gate that there is."""
    return next(gate for gate in scenario.gates if gate.name == name)


def ahead_of(gate: "Gate") -> Series:
    """Return the direction in which a gate is crossed, (2,), unit length."""
    heading = np.radians(gate.heading_deg)
    return np.array([np.sin(heading), np.cos(heading)])


def crossings(path: Series, gate: "Gate") -> list[int]:
    """Return samples after which a path, (T, 2) or (T, 3), has crossed a gate in its direction."""
    ahead = ahead_of(gate)
    right = np.array([ahead[1], -ahead[0]])
    offset = path[:, :2] - np.array(gate.center)
    along, aside = offset @ ahead, offset @ right
    steps = np.flatnonzero((along[:-1] < 0.0) & (along[1:] >= 0.0))
    share = -along[steps] / (along[steps + 1] - along[steps])
    at = aside[steps] + share * (aside[steps + 1] - aside[steps])
    return [int(step) + 1 for step in steps[np.abs(at) <= gate.half_width]]
