"""Fuel: which tanks feed which engines, what is left of it, and what the machine weighs then."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Final

import numpy as np

from buildarena_simulation.structure.clusters import connected_components
from buildarena_simulation.structure.model import BoolArray, FloatArray, IntArray, Structure
from buildarena_simulation.structure.own_forces import OwnForces

_GRAIN: Final = 0.005
"""Share of its mass by which a cluster may weigh other than the engine was told. Ours: it is told
what will be left when half as much again is burnt, so that the error is as often above as below."""


class Tanks:
    """The fuel of a machine in a trial.

    Blocks that take fuel and are joined to each other, directly or by hoses, are one system. Its
    fuel is level at once: every tank of it is as full as the others.

    Args:
        structure: The machine, with full tanks.
        forces: What its blocks exert.

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
        """Takes the joints that hold from now on: tanks that came off feed nothing else.

        Args:
            holds: (M,) which members do.
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
        """Burns what is asked for, and says how far each block can push.

        Args:
            pushing: (P,) how far each is asked to, -1 to 1.
            seconds: For how long.

        Returns:
            (P,) the same, less where a system runs out meanwhile.
        """
        wanted = np.abs(pushing) * self._rates * seconds
        if not wanted.any():
            return pushing
        systems = self._system[self._engines]
        count = len(self._system)
        asked = np.bincount(systems, wanted, minlength=count)
        there = np.bincount(self._system, self.left, minlength=count)
        share = np.minimum(1.0, there / np.maximum(asked, 1e-12))
        room = np.bincount(self._system, self._room, minlength=count)
        level = np.maximum(there - asked, 0.0) / np.maximum(room, 1e-12)
        self.left = self._room * level[self._system]
        return np.where(wanted > 0.0, pushing * share[systems], pushing)

    def lighter(self, cluster_of: IntArray) -> Structure | None:
        """The machine as it weighs now; None while nothing weighs noticeably less than told last.

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
        there = np.bincount(self._system, self.left, minlength=count)
        room = np.bincount(self._system, self._room, minlength=count)
        self.left = self._room * (there / np.maximum(room, 1e-12))[self._system]


def tanks_of(structure: Structure, forces: OwnForces | None) -> Tanks | None:
    """The fuel of a machine; None where nothing burns any."""
    if forces is None:
        return None
    pushes: Iterable[int] = forces.pushes.tolist()
    burns = [push.fuel for block in pushes if (push := structure.parts[block].module.push)]
    return Tanks(structure, forces) if any(burns) else None
