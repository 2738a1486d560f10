"""Forces on a machine's blocks besides gravity, measured in the engine over an interval."""

from dataclasses import dataclass, replace

import numpy as np

from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.engines.base import CargoPose, Engine, World
from buildarena_simulation.holding import Holding
from buildarena_simulation.landing import Landing, landing_of
from buildarena_simulation.resting import FaceFinder
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.contacts import (
    CARGO,
    ContactForces,
    EvenSharing,
    PointForces,
    together,
)
from buildarena_simulation.structure.loads import LoadModel
from buildarena_simulation.structure.model import FloatArray, Structure
from buildarena_simulation.structure.motion import Motion, rope_ends
from buildarena_simulation.structure.supports import EdgeSupports, Settled
from buildarena_simulation.structure.vectors import turned


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """State at the beginning of an interval, the steps between two evaluations.

    Attributes:
        end_s: Time at its end, seconds.
        length_s: Duration, seconds.
        thrusts: (C,) recoil of each cannon, mass·unit/s².
        cargo: Its pose at the start; None without cargo.
        cargo_mass: Mass units.
        landing: Landing on the machine until then; None if there was none.
    """

    end_s: float
    length_s: float
    thrusts: FloatArray
    cargo: CargoPose | None = None
    cargo_mass: float | None = None
    landing: Landing | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Acted:
    """Forces on a machine in an interval.

    Attributes:
        forces: Forces on its blocks, where the structure takes them.
        landing: Landing of the cargo on the machine; None if there is none.
        bearing: (K + 2 + W,) loads on the ground, K terrains, the machine under its cargo, and W
            wheels, mass·g, see `Bearing`.
        on_blocks: (N,) upward force of ground and terrain on each block, mass·g.
    """

    forces: PointForces
    landing: Landing | None
    bearing: FloatArray
    on_blocks: FloatArray


class Surrounded:
    """A machine of some clusters, with everything that can exert forces on it.

    Args:
        holding: Holds of its blocks; None if no block can hold.
    """

    def __init__(self, world: World, holding: Holding | None) -> None:
        self._world, self._holding = world, holding
        self._faces = FaceFinder(world)
        self._machine_mass = float(world.structure.masses.sum())

    def enter(self, structure: Structure, clusters: Clusters) -> None:
        """Set the machine with its present masses, and its clusters."""
        of = clusters.cluster_of
        self._clusters, self._sharing = clusters, EvenSharing(of)
        self._supports = EdgeSupports(structure.centers_of_mass, of, gravity=GRAVITY)

    def acted(
        self,
        engine: Engine,
        interval: Interval,
        motion: Motion,
        tensions: FloatArray,
        elastic: LoadModel,
    ) -> Acted:
        """Return the forces of an interval that has just passed.

        Args:
            interval: State at its beginning.
            tensions: (R,) of the ropes, mass·unit/s².
            elastic: Compliance of the structure under supports at edges.
        """
        world, clusters, holding = self._world, self._clusters, self._holding
        cargo = None if world.cargo is None else engine.cargo()
        faces = self._faces.find(clusters, motion, cargo)
        contacts, landing = self._contacts(engine, interval, cargo)
        contacts = faces.joined_to(contacts, clusters.cluster_of)
        loads = []
        if len(interval.thrusts):
            loads.append(recoils(world.structure, clusters, motion, interval.thrusts))
        if len(tensions):
            loads.append(rope_pulls(world.structure, clusters, motion, tensions))
        if holding is not None:
            loads.append(holding.forces(clusters, motion))
        if world.field is not None:
            loads.append(world.field.take_mean(clusters, motion))
        settled = self._supports.settled(
            contacts,
            self._sharing.shared(contacts),
            corners=faces.corners,
            structure=elastic,
            motion=motion,
            further_forces=loads,
        )
        bearing, on_blocks = find_supports(settled, world)
        if holding is not None:
            ground, held = holding.lifts()
            bearing[0] += ground
            bearing[len(world.terrain) + 1] += held
        return Acted(
            forces=together([settled.forces, *loads]),
            landing=landing,
            bearing=bearing,
            on_blocks=on_blocks,
        )

    def _contacts(
        self, engine: Engine, interval: Interval, cargo: CargoPose | None
    ) -> tuple[ContactForces, Landing | None]:
        """Return the engine's contacts, including the cargo's bounce."""
        contacts = engine.contacts()
        if interval.cargo is None or cargo is None:
            return contacts, None
        landing = landing_of(
            contacts,
            interval.cargo,
            cargo,
            so_far=interval.landing,
            mass=interval.cargo_mass or 0.0,
            machine_mass=self._machine_mass,
            gravity=self._world.gravity,
            interval_s=interval.length_s,
        )
        if landing is not None and landing.counts:
            contacts = replace(contacts, force=landing.stress * contacts.force)
        return contacts, landing


def recoils(
    structure: Structure, clusters: Clusters, motion: Motion, thrusts: FloatArray
) -> PointForces:
    """Return the recoil of the cannons' thrusts, (C,) mass·unit/s², as forces on the blocks."""
    cannons = structure.cannons
    c = clusters.cluster_of[cannons]
    turn = motion.rotation[c]
    return PointForces(
        block=cannons,
        point=motion.position[c] + turned(turn, structure.thrust_points),
        force=-thrusts[:, None] * turned(turn, structure.directions[cannons]),
    )


def rope_pulls(
    structure: Structure, clusters: Clusters, motion: Motion, tensions: FloatArray
) -> PointForces:
    """Return the forces of ropes with tensions (R,) mass·unit/s² on the blocks at both ends."""
    ropes = structure.ropes
    start, end = rope_ends(structure, clusters, motion)
    pull = end - start
    pull *= (tensions / np.maximum(np.linalg.norm(pull, axis=1), 1e-9))[:, None]
    return PointForces(
        block=np.concatenate([ropes.first, ropes.second]),
        point=np.concatenate([start, end]),
        force=np.concatenate([pull, -pull]),
    )


def find_supports(settled: Settled, world: World) -> tuple[FloatArray, FloatArray]:
    """Return a machine's supports and the loads on its blocks from its contacts; see `Acted`."""
    surfaces, blocks = len(world.terrain) + 1, len(world.structure)
    up = settled.forces.force[:, 2] / world.gravity
    fixed = (settled.surface >= 0).nonzero()[0]
    loads = up.take(fixed)
    on_surface = np.bincount(settled.surface.take(fixed), loads, surfaces)
    on_block = np.bincount(settled.forces.block.take(fixed), loads, blocks)
    cargo = -up[settled.other == CARGO].sum()
    bearing = np.concatenate([on_surface, [cargo], on_block[world.structure.wheels]])
    return bearing, np.asarray(on_block, dtype=np.float64)
