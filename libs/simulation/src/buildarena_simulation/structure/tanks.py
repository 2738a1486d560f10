"""Fuel: which tanks feed which engines, what is left of it, and what the machine weighs then."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Final

import numpy as np

from buildarena_simulation.structure.clusters import connected_components
from buildarena_simulation.structure.model import BoolArray, FloatArray, IntArray, Structure
from buildarena_simulation.structure.own_forces import OwnForces

_GRAIN: Final = 0.005
"""Maximum error of a cluster's mass in the engine, as a share. Ours: the engine gets the mass that
remains when half as much again is burnt, so that the error is as often above as below."""


class Tanks:
    """Fuel of a machine in a trial.

    Blocks that take fuel and are joined to each other, directly or by hoses, are one system. Its
    fuel is level at once: every tank of it is as full as the others.

    Args:
        structure: Machine with full tanks.

    Attributes:
        left: (N,) fuel in each block.
    """

    def __init__(self, structure: Structure, forces: OwnForces) -> None:
        self._full = structure
        tanks = [part.module.tank for part in structure.parts]
        self._takes = np.array([tank is not None for tank in tanks])
        self._room = np.array([tank.fuel if tank else 0.0 for tank in tanks])
        weights = np.array([tank.mass if tank else 0.0 for tank in tanks])
        self._mass_of_fuel = weights / np.maximum(self._room, 1e-9)
        self.left: FloatArray = self._room.copy()
        pushes = [structure.parts[block].module.push for block in forces.pushes]
        self._engines = forces.pushes
        self._rates = np.array([push.fuel if push else 0.0 for push in pushes])
        self._burnt: FloatArray = np.zeros(len(structure))
        self._weighed: FloatArray = structure.masses
        self._holds: BoolArray = np.zeros(0, dtype=bool)
        self._system: IntArray = np.arange(len(structure))
        self.join(np.ones(len(structure.members), dtype=bool))

    def join(self, holds: BoolArray) -> None:
        """Set the joints that hold from now on; tanks that came off supply nothing else.

        Args:
            holds: (M,) true for members that hold.
        """
        if np.array_equal(holds, self._holds):
            return
        self._holds, members = holds.copy(), self._full.members
        pairs = np.column_stack([members.first[holds], members.second[holds]])
        edges = [(int(a), int(b)) for a, b in pairs if self._takes[a] and self._takes[b]]
        groups = connected_components(len(self._full), [*edges, *self._full.hoses])
        for system, blocks in enumerate(groups):
            self._system[blocks] = system
        self._level()

    def supply(self, pushing: FloatArray, seconds: float) -> FloatArray:
        """Burn fuel for commands, and return the commands that it allows.

        Args:
            pushing: (P,) command to each block, -1 to 1.
            seconds: Duration.

        Returns:
            (P,) commands, reduced if a system runs out meanwhile.
        """
        demand = np.abs(pushing) * self._rates * seconds
        if not demand.any():
            return pushing
        systems = self._system[self._engines]
        count = len(self._system)
        asked = np.bincount(systems, demand, minlength=count)
        supply = np.bincount(self._system, self.left, minlength=count)
        share = np.minimum(1.0, supply / np.maximum(asked, 1e-12))
        room = np.bincount(self._system, self._room, minlength=count)
        level = np.maximum(supply - asked, 0.0) / np.maximum(room, 1e-12)
        self.left = self._room * level[self._system]
        return np.where(demand > 0.0, pushing * share[systems], pushing)

    def lighter(self, cluster_of: IntArray) -> Structure | None:
        """Return the machine with its present masses; None if they have hardly changed.

        Args:
            cluster_of: (N,) the cluster of each block.
        """
        burnt = self._room - self.left
        masses = self._full.masses - burnt * self._mass_of_fuel
        before, now = (np.bincount(cluster_of, of) for of in (self._weighed, masses))
        if (np.abs(now / before - 1.0) < _GRAIN).all():
            return None
        ahead = np.clip(burnt + (burnt - self._burnt) / 2, 0.0, self._room)
        self._burnt, self._weighed = burnt, self._full.masses - ahead * self._mass_of_fuel
        share = self._weighed / self._full.masses
        inertias = self._full.inertias * share[:, None, None]
        return replace(self._full, masses=self._weighed, inertias=inertias)

    def _level(self) -> None:
        count = len(self._system)
        fuel = np.bincount(self._system, self.left, minlength=count)
        room = np.bincount(self._system, self._room, minlength=count)
        self.left = self._room * (fuel / np.maximum(room, 1e-12))[self._system]


def tanks_of(structure: Structure, forces: OwnForces | None) -> Tanks | None:
    """Return the fuel of a machine; None if no block burns any."""
    if forces is None:
        return None
    pushes: Iterable[int] = forces.pushes.tolist()
    burns = [push.fuel for block in pushes if (push := structure.parts[block].module.push)]
    return Tanks(structure, forces) if any(burns) else None
