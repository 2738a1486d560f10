"""From what is asked for to commands, of a whole trial at once or of one tick, and their fuel."""

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Keys:
    """Keys that are pressed whatever happens.

    Attributes:
        bindings: The keys of each part's actions.
        presses: The control sequence.
        count: Whether anybody presses them in this trial.
    """

    bindings: Bindings
    presses: Sequence[KeyHold]
    count: bool

    def levels(self, times: FloatArray) -> Levels:
        """What they ask for at some times, (S,), seconds."""
        return key_levels(self.bindings, self.presses if self.count else (), times)

    def holds(self) -> list[KeyHold]:
        """The presses that reach some block's action."""
        return reaching(self.bindings, self.presses)

    def piloting(self) -> None:
        """What a program sensed and asked for: there is none."""

    def settings(self) -> dict[str, str]:
        """What a trajectory keeps of who acts; of keys nothing beside `holds`."""
        return {}


class Planner:
    """Plans steps that follow each other.

    Args:
        structure: The machine.
        field: What its blocks exert by themselves; None where none does.
        scenario: Who acts, and how much fuel there is.
        time_step_s: Length of a step, seconds.

    Attributes:
        tank: The fuel that is left after the planned steps.
        first: The first step that is planned.
        drives: Commands of the planned steps.
        forces: The same to blocks that exert forces; None where none does.
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
        """When some steps begin, (S,), seconds."""
        return self._time_step_s * np.arange(first, first + count, dtype=np.float64)

    def plan(self, levels: Levels, first: int, count: int) -> None:
        """Plans the steps after those planned before.

        Args:
            levels: What is asked for in them.
            first: The first of them.
            count: How many.
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
