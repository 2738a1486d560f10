"""Follows what a machine's grips hold through a trial."""

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from buildarena_simulation.constants import GRAVITY, LOAD_FILTER_S
from buildarena_simulation.engines.base import CargoPose, Engine, World, rotation_of
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.contacts import CARGO, WORLD, PointForces
from buildarena_simulation.structure.grips import Hold, distances, grips_of
from buildarena_simulation.structure.model import BoolArray, FloatArray, Shape
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.terrain import shape_of
from buildarena_simulation.trajectory import Event

_NONE: Final = PointForces(
    block=np.zeros(0, dtype=np.int64), point=np.zeros((0, 3)), force=np.zeros((0, 3))
)


class Holding:
    """Holds of the grips: each holds the first object within reach until it is released."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._grips = grips_of(world.structure)
        count = len(self._grips)
        self._ready = np.ones(count, dtype=bool)
        self._loads = np.zeros((count, 6))
        self._held: dict[int, tuple[Hold, str]] = {}
        self._borne: list[tuple[Hold, FloatArray]] = []
        self.events: list[Event] = []

    @property
    def holds(self) -> tuple[Hold, ...]:
        """Present holds."""
        return tuple(hold for hold, _ in self._held.values())

    def update(
        self,
        clusters: Clusters,
        motion: Motion,
        cargo: CargoPose | None,
        *,
        grab: BoolArray,
        release: BoolArray,
        time_s: float,
    ) -> bool:
        """Take hold of objects and release them.

        Args:
            cargo: Pose of the cargo, if there is one.
            grab: (G,) true for grips to hold again.
            release: (G,) true for grips to release; it takes precedence over `grab`.
            time_s: Time now, seconds.

        Returns:
            True if anything changed.
        """
        before = len(self.events)
        self._ready = (self._ready | grab) & ~release
        for k in np.flatnonzero(release):
            self._drop(int(k), "released", time_s)
        for k in np.flatnonzero(self._ready):
            if int(k) not in self._held:
                self._seek(int(k), clusters, motion, cargo, time_s)
        return len(self.events) > before

    def read(self, engine: Engine) -> None:
        """Read the loads of the holds from the engine."""
        self._borne = list(zip(self.holds, engine.grip_wrenches(), strict=True))

    def follow(self, engine: Engine, *, time_s: float, interval_s: float) -> bool:
        """Filter the loads of the holds, and release the overloaded ones.

        Args:
            engine: Source of the loads.
            time_s: Time now, seconds.
            interval_s: Time since the last call, seconds.

        Returns:
            True if anything slipped.
        """
        blend = 1.0 - math.exp(-interval_s / LOAD_FILTER_S)
        slipped = False
        self.read(engine)
        for hold, wrench in self._borne:
            load = self._loads[hold.grip]
            load += blend * (wrench / GRAVITY - load)
            norms = np.linalg.norm(load.reshape(2, 3), axis=1)
            if (norms > self._grips.limits[hold.grip]).any():
                self._drop(hold.grip, "slipped", time_s)
                self._ready[hold.grip] = False
                slipped = True
        return slipped

    def forces(self, clusters: Clusters, motion: Motion) -> PointForces:
        """Return the forces of the holds on holding and held blocks at the last `follow`."""
        if not self._borne:
            return _NONE
        rows = []
        for hold, wrench in self._borne:
            c = clusters.cluster_of[hold.block]
            point = motion.position[c] + motion.rotation[c] @ hold.point
            for at, force in _as_forces(point, wrench):
                rows.append((hold.block, at, force))
                if hold.other >= 0:
                    rows.append((hold.other, at, -force))
        return PointForces(
            block=np.array([block for block, _, _ in rows], dtype=np.int64),
            point=np.array([point for _, point, _ in rows]),
            force=np.array([force for _, _, force in rows]),
        )

    def lifts(self) -> tuple[float, float]:
        """Return the holds' upward forces: of the ground on grips, of grips on the cargo.

        Returns:
            Both in mass·g, as in `Bearing`; terrain that is held counts as ground.
        """
        on = dict.fromkeys((WORLD, CARGO), 0.0)
        for hold, wrench in self._borne:
            if hold.other in on:
                on[hold.other] += float(wrench[2]) / self._world.gravity
        return on[WORLD], -on[CARGO]

    def _drop(self, k: int, event: str, time_s: float) -> None:
        if k in self._held:
            _, name = self._held.pop(k)
            self._loads[k] = 0.0
            self._tell(k, event, name, time_s)

    def _tell(self, k: int, event: str, name: str, time_s: float) -> None:
        block = self._world.structure.parts[self._grips.blocks[k]].id
        self.events.append(Event(time_s=round(time_s, 6), what=event, joint=block, held=name))

    def _seek(
        self, k: int, clusters: Clusters, motion: Motion, cargo: CargoPose | None, time_s: float
    ) -> None:
        """Take hold of the nearest object within reach, if there is one."""
        grips, block = self._grips, self._grips.blocks[k]
        c = int(clusters.cluster_of[block])
        points = motion.position[c] + grips.places[k] @ motion.rotation[c].T
        reach, candidates = float(grips.reach[k]), []
        if self._world.ground:
            candidates.append((max(0.0, float(points[:, 2].min())), WORLD, "ground"))
        for name, other, shape in self._things(cargo):
            gap = np.linalg.norm(points[4] - shape.center)
            if gap < reach + np.linalg.norm(shape.half_extents) + np.ptp(points, axis=0).max():
                candidates.append((float(distances(points, [shape])[0]), other, name))
        candidates += self._near_blocks(points, c, clusters, motion, reach)
        nearest = min(candidates, default=None)
        if nearest is not None and nearest[0] <= reach:
            hold = Hold(grip=k, block=block, other=nearest[1], point=grips.tips[k])
            self._held[k] = (hold, nearest[2])
            self._tell(k, "grabbed", nearest[2], time_s)

    def _things(self, cargo: CargoPose | None) -> Iterator[tuple[str, int, Shape]]:
        for number, box in enumerate(self._world.terrain, start=1):
            yield f"terrain {number}", WORLD, shape_of(box)
        if cargo is not None and self._world.cargo is not None:
            turn = rotation_of(cargo.quaternion)
            yield "cargo", CARGO, self._world.cargo.shape(cargo.position, turn)

    def _near_blocks(
        self, points: FloatArray, c: int, clusters: Clusters, motion: Motion, reach: float
    ) -> list[tuple[float, int, str]]:
        """Return the blocks of other components within reach: distance, block, id."""
        candidates = []
        structure = self._world.structure
        is_other = clusters.root[clusters.cluster_of] != clusters.root[c]
        for block in np.flatnonzero(is_other).tolist():
            other = clusters.cluster_of[block]
            local = (points - motion.position[other]) @ motion.rotation[other]
            shapes: Sequence[Shape] = structure.parts[block].shapes
            gap = float(distances(local, shapes).min())
            if gap <= reach:
                candidates.append((gap, block, structure.parts[block].id))
        return candidates


def _as_forces(point: FloatArray, wrench: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield a force at a point, and a pair of forces at half a unit from it with the moment."""
    force, moment = wrench[:3], wrench[3:]
    yield point, force
    size = float(np.linalg.norm(moment))
    if size > 0.0:
        across = np.cross(moment, np.eye(3)[int(np.abs(moment).argmin())])
        across /= np.linalg.norm(across)
        pull = np.cross(moment, across)
        yield point + across / 2, pull
        yield point - across / 2, -pull
