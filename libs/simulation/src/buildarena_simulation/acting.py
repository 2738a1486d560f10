"""What acts on a machine's blocks beside gravity, read off the engine after an interval."""

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
    """What the steps between two evaluations began with.

    Attributes:
        end_s: Time at its end, seconds.
        length_s: How long it was, seconds.
        thrusts: (C,) recoil of each cannon, mass·unit/s².
        cargo: The cargo at its start; None without one.
        cargo_mass: Its mass.
        landing: How it had landed on the machine until then.
    """

    end_s: float
    length_s: float
    thrusts: FloatArray
    cargo: CargoPose | None = None
    cargo_mass: float | None = None
    landing: Landing | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Acted:
    """What acted on a machine in an interval.

    Attributes:
        forces: On its blocks, where the structure takes them.
        landing: How the cargo lands on the machine; None if it does not.
        bearing: (K + 2 + W,) what the ground, K terrains, the machine under its cargo, and W wheels
            bear, mass·g, see `Bearing`.
        on_blocks: (N,) what ground and terrain exert on each block upwards, mass·g.
    """

    forces: PointForces
    landing: Landing | None
    bearing: FloatArray
    on_blocks: FloatArray


class Surrounded:
    """A machine of some clusters among what may act on it.

    Args:
        world: The machine and what is around it.
        holding: What its blocks hold; None where none can.
    """

    def __init__(self, world: World, holding: Holding | None) -> None:
        self._world, self._holding = world, holding
        self._faces = FaceFinder(world)
        self._machine_mass = float(world.structure.masses.sum())

    def enter(self, structure: Structure, clusters: Clusters) -> None:
        """Takes the machine as it weighs now and the clusters it is made of."""
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
        """What acted in an interval that has just passed.

        Args:
            engine: The engine.
            interval: What it began with.
            motion: The clusters' motion now.
            tensions: (R,) of the ropes, mass·unit/s².
            elastic: How the structure gives way under what rests on edges.
        """
        world, clusters, holding = self._world, self._clusters, self._holding
        cargo = None if world.cargo is None else engine.cargo()
        faces = self._faces.find(clusters, motion, cargo)
        contacts, landing = self._contacts(engine, interval, cargo)
        contacts = faces.joined_to(contacts, clusters.cluster_of)
        others = []
        if len(interval.thrusts):
            others.append(recoils(world.structure, clusters, motion, interval.thrusts))
        if len(tensions):
            others.append(rope_pulls(world.structure, clusters, motion, tensions))
        if holding is not None:
            others.append(holding.forces(clusters, motion))
        if world.field is not None:
            others.append(world.field.taken(clusters, motion))
        settled = self._supports.settled(
            contacts,
            self._sharing.shared(contacts),
            corners=faces.corners,
            structure=elastic,
            motion=motion,
            others=others,
        )
        bearing, on_blocks = borne_by(settled, world)
        if holding is not None:
            ground, held = holding.lifts()
            bearing[0] += ground
            bearing[len(world.terrain) + 1] += held
        return Acted(
            forces=together([settled.forces, *others]),
            landing=landing,
            bearing=bearing,
            on_blocks=on_blocks,
        )

    def _contacts(
        self, engine: Engine, interval: Interval, cargo: CargoPose | None
    ) -> tuple[ContactForces, Landing | None]:
        """The engine's contacts, with what the cargo's bounce adds to them."""
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
    """What the cannons' thrusts, (C,) mass·unit/s², do to them."""
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
    """What ropes of some tensions, (R,) mass·unit/s², do to the blocks at both of their ends."""
    ropes = structure.ropes
    start, end = rope_ends(structure, clusters, motion)
    pull = end - start
    pull *= (tensions / np.maximum(np.linalg.norm(pull, axis=1), 1e-9))[:, None]
    return PointForces(
        block=np.concatenate([ropes.first, ropes.second]),
        point=np.concatenate([start, end]),
        force=np.concatenate([pull, -pull]),
    )


def borne_by(settled: Settled, world: World) -> tuple[FloatArray, FloatArray]:
    """What bears a machine and what it bears, by its contacts; see `Acted`."""
    surfaces, blocks = len(world.terrain) + 1, len(world.structure)
    up = settled.forces.force[:, 2] / world.gravity
    fixed = (settled.surface >= 0).nonzero()[0]
    borne = up.take(fixed)
    on_surface = np.bincount(settled.surface.take(fixed), borne, surfaces)
    on_block = np.bincount(settled.forces.block.take(fixed), borne, blocks)
    cargo = -up[settled.other == CARGO].sum()
    bearing = np.concatenate([on_surface, [cargo], on_block[world.structure.wheels]])
    return bearing, np.asarray(on_block, dtype=np.float64)
