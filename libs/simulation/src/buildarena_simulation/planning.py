"""Conversion of levels to commands, for a whole trial or for one tick, and fuel."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.control import (
    Bindings,
    Drives,
    KeyHold,
    Levels,
    Schedule,
    key_levels,
    plan_schedule,
    reaching,
)
from buildarena_simulation.force_control import ForceSchedule, ForceState, plan_forces
from buildarena_simulation.scenario import Scenario
from buildarena_simulation.structure.force_field import ForceField
from buildarena_simulation.structure.grips import grips_of
from buildarena_simulation.structure.model import FloatArray, Structure
from buildarena_simulation.structure.own_forces import OwnForces


class Tank:
    """Fuel of fans and cannons.

    The commanded push burns it, whether or not it lifts; a cannon burns as if it were heated.

    Args:
        structure: Machine, whose weight at the start is held up by one second's fuel for one
            second.
        forces: None if no block exerts forces.
        scenario: Scenario with the amount.

    Attributes:
        left_s: Fuel that is left, seconds; infinite if the scenario sets no bound.
    """

    def __init__(self, structure: Structure, forces: OwnForces | None, scenario: Scenario) -> None:
        self.left_s = np.inf if scenario.fuel_s is None else scenario.fuel_s
        weight = float(structure.masses.sum()) * scenario.gravity
        self._cannons: FloatArray = structure.heated_thrusts * GRAVITY / weight
        self._fans: FloatArray = np.zeros(0) if forces is None else forces.push / weight

    def burn(self, drives: Schedule, forces: ForceSchedule | None, time_step_s: float) -> None:
        """Burn the fuel of some steps' commands, and clear the commands once it is empty.

        Args:
            forces: Commands to fans; None if there are none.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Keys:
    """Keys that are pressed at fixed times.

    Attributes:
        bindings: The keys of each part's actions.
        count: True if the keys are pressed in this trial.
    """

    bindings: Bindings
    presses: Sequence[KeyHold]
    count: bool

    def levels(self, times: FloatArray) -> Levels:
        """Return their levels at some times, (S,), seconds."""
        return key_levels(self.bindings, self.presses if self.count else (), times)

    def holds(self) -> list[KeyHold]:
        """Return the presses that reach some block's action."""
        return reaching(self.bindings, self.presses)

    def piloting(self) -> None:
        """Return None: there is no program."""

    def settings(self) -> dict[str, str]:
        """Return a trajectory's settings on the controller; empty for keys."""
        return {}


class Planner:
    """Planner of successive steps.

    Args:
        field: Forces that blocks exert by themselves; None if there are none.
        scenario: Its control and its fuel.
        time_step_s: Length of a step, seconds.

    Attributes:
        tank: Fuel that is left after the planned steps.
        first: First planned step.
        drives: Commands of the planned steps.
        forces: Commands to blocks that exert forces; None if there are none.
    """

    drives: Schedule
    forces: ForceSchedule | None = None

    def __init__(
        self, structure: Structure, field: ForceField | None, scenario: Scenario, time_step_s: float
    ) -> None:
        self._structure, self._time_step_s = structure, time_step_s
        self._control = scenario.control
        self._table = None if field is None else field.table
        self.tank = Tank(structure, self._table, scenario)
        self._drives = Drives(structure, time_step_s)
        self._force_state = (
            None if self._table is None else ForceState.still(structure, self._table)
        )
        self._grips = grips_of(structure)
        self.first = 0

    def times(self, first: int, count: int) -> FloatArray:
        """Return the beginnings of some steps, (S,), seconds."""
        return self._time_step_s * np.arange(first, first + count, dtype=np.float64)

    def plan(self, levels: Levels, first: int, count: int) -> None:
        """Plan the steps that follow those planned before.

        Args:
            levels: Commands from keys or a program.
            first: First of them.
            count: Number of steps.
        """
        self.first, times = first, self.times(first, count)
        self.drives = plan_schedule(
            self._structure,
            levels,
            self._drives,
            control=self._control,
            times=times,
        )
        if self._table is not None and self._force_state is not None:
            self.forces = plan_forces(
                self._structure,
                self._table,
                levels,
                self._force_state,
                grips=self._grips,
                control=self._control,
                times=times,
                time_step_s=self._time_step_s,
            )
        self.tank.burn(self.drives, self.forces, self._time_step_s)
