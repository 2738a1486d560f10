"""Fuel: for how long fans and cannons may push."""

import math

import numpy as np

from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.control import Schedule
from buildarena_simulation.force_control import ForceSchedule
from buildarena_simulation.scenario import Scenario
from buildarena_simulation.structure.model import FloatArray, Structure
from buildarena_simulation.structure.own_forces import OwnForces


class Tank:
    """What is left for fans and cannons.

    What they are asked to push burns it, whether or not that lifts: a cannon as if it were heated.

    Args:
        structure: The machine, whose weight at the start is what a second of fuel holds up for
            one.
        forces: What its blocks exert by themselves; None where none does.
        scenario: Says how much there is.

    Attributes:
        left_s: So much, seconds; infinite where the scenario sets no bound.
    """

    def __init__(self, structure: Structure, forces: OwnForces | None, scenario: Scenario) -> None:
        self.left_s = np.inf if scenario.fuel_s is None else scenario.fuel_s
        weight = float(structure.masses.sum()) * scenario.gravity
        self._cannons: FloatArray = structure.heated_thrusts * GRAVITY / weight
        self._fans: FloatArray = np.zeros(0) if forces is None else forces.push / weight

    def burn(self, drives: Schedule, forces: ForceSchedule | None, time_step_s: float) -> None:
        """Takes what some steps ask for, and leaves nothing of what is asked for once it is empty.

        Args:
            drives: Commands to cannons.
            forces: Commands to fans; None without any.
            time_step_s: Length of a step, seconds.
        """
        if math.isinf(self.left_s):
            return
        burnt = drives.firing @ self._cannons
        if forces is not None:
            burnt = burnt + np.abs(forces.pushing) @ self._fans
        left = self.left_s - time_step_s * np.cumsum(burnt)
        empty = left < 0.0
        drives.firing[empty] = 0.0
        if forces is not None:
            forces.pushing[empty] = 0.0
        self.left_s = max(0.0, float(left[-1]))
