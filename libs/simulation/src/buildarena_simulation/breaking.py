"""Breaking: the worst joint over its strength gives way, one per evaluation."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from buildarena_simulation.bearing import BearingMeter
from buildarena_simulation.constants import BLOW_FILTER_S, GRAVITY
from buildarena_simulation.engines.base import CargoPose, Engine, World
from buildarena_simulation.holding import Holding
from buildarena_simulation.landing import Landing, landing_of
from buildarena_simulation.resting import FaceFinder
from buildarena_simulation.structure.clusters import Clusters, find_clusters
from buildarena_simulation.structure.contacts import (
    ContactForces,
    EvenSharing,
    PointForces,
    together,
)
from buildarena_simulation.structure.loads import JointLoads, LoadModel
from buildarena_simulation.structure.model import (
    JOINT_KINDS,
    BoolArray,
    FloatArray,
    IntArray,
    Structure,
)
from buildarena_simulation.structure.motion import Motion, rope_ends
from buildarena_simulation.structure.supports import EdgeSupports
from buildarena_simulation.structure.vectors import turned
from buildarena_simulation.trajectory import Break, Event, JointPeak

_CALM: Final = 0.5
"""Share of its strength below which no joint is in danger."""

_BLOW: Final = 3.0
"""A load that rises by this factor from one evaluation to the next may be an error of the step."""


class BreakingModel:
    """Follows a machine's loads and lets its joints break.

    While no joint bears half its strength and nothing is struck, every other evaluation is left
    out: with the filter's time constant four times the interval, no joint can break in between
    unless its load rises almost threefold at once.

    A load that would break something after it rose threefold at once counts only if steps of half
    the length show it as well: engines make up blows now and then.

    Args:
        world: The machine and what is around it.
        clusters: Its clusters at the start.
        motion: Their motion at the start.
        interval_s: Time between two evaluations, seconds.

    Attributes:
        holding: What blocks hold; None where none can.
        landing: How the cargo lands on the machine; None if it does not, or if something broke.
    """

    def __init__(
        self, world: World, clusters: Clusters, motion: Motion, *, interval_s: float
    ) -> None:
        structure = self._structure = world.structure
        self._field, self._gravity = world.field, world.gravity
        self._faces, self._has_cargo = FaceFinder(world), world.cargo is not None
        self.bearing = BearingMeter(structure, len(world.terrain), gravity=world.gravity)
        self._loads = LoadModel(structure, clusters, motion, gravity=world.even_gravity)
        self._enter(clusters)
        self._interval_s, self._unseen_s, self._calm = interval_s, 0.0, False
        self._peaks = np.zeros((3, len(structure.members)))
        self._loads_now = np.zeros(len(structure.members) + len(structure.ropes))
        self._loads_since: FloatArray | None = None
        self._rope_holds = np.ones(len(structure.ropes), dtype=bool)
        self._rope_peaks = np.zeros(len(structure.ropes))
        self.motion = motion
        self.breaks: list[Break] = []
        self.events: list[Event] = []
        self.holding: Holding | None = None
        self.landing: Landing | None = None
        self._landed: Landing | None = None
        self._cargo_before: CargoPose | None = None
        self._cargo_mass, self._machine_mass = 0.0, float(structure.masses.sum())

    def blow(self, wind: FloatArray) -> None:
        """Says what accelerates masses from now on beside even gravity; see `LoadModel.wind`."""
        self._loads.wind = wind

    @property
    def holds(self) -> BoolArray:
        """Which joints hold, (M,)."""
        return self._loads.holds

    def weigh(self, engine: Engine, structure: Structure) -> None:
        """Takes the machine as it weighs now.

        Args:
            engine: The engine, which is given new bodies.
            structure: The same machine with other masses.
        """
        self._structure, before = structure, self.clusters
        after = find_clusters(structure, self._loads.holds)
        self.motion = self.motion.after_break(before, after)
        self._loads.weigh(structure)
        self._enter(after)
        engine.enter(after, self.motion)
        self._loads.rebuild(after, self.motion)

    def follow(
        self,
        engine: Engine,
        motion: Motion,
        thrusts: FloatArray,
        *,
        time_s: float,
        cargo_mass: float | None,
        cargo_before: CargoPose | None = None,
        repeat_finer: Callable[[], Motion] | None = None,
    ) -> None:
        """Evaluates the loads after one interval and breaks what is overloaded.

        Args:
            engine: The engine, which is given new bodies if the machine falls apart.
            motion: The clusters' motion now.
            thrusts: (C,) recoil of each cannon during the interval, mass·unit/s².
            time_s: Time now, seconds.
            cargo_mass: Mass of the cargo now.
            cargo_before: The cargo at the start of the interval.
            repeat_finer: Repeats the interval in finer steps and says how the clusters move then;
                None where it cannot be repeated.
        """
        self.motion, self.landing, self._landed = motion, None, self.landing
        self._cargo_before, self._cargo_mass = cargo_before, cargo_mass or 0.0
        self._unseen_s += self._interval_s
        if self._calm and not engine.struck and self._landed is None:
            self._calm = False
            return
        filters = self._loads.filters()
        loads, tensions = self._evaluated(engine, thrusts)
        if repeat_finer is not None and self._is_blow(loads, tensions):
            self._loads.put_back(filters)
            self.motion = repeat_finer()
            loads, tensions = self._evaluated(engine, thrusts)
            engine.enter(self.clusters, self.motion)
        self._unseen_s = 0.0
        self._calm = bool(loads.ratio.max(initial=0.0) < _CALM) and not engine.struck
        for peak, seen in zip(self._peaks, (loads.force, loads.moment, loads.ratio), strict=True):
            np.maximum(peak, seen, out=peak)
        self._follow_loads(loads.ratio, tensions)
        self._break_ropes(engine, tensions, time_s, cargo_mass)
        if not len(loads.ratio):
            return
        worst = int(np.argmax(loads.ratio))
        if loads.ratio[worst] > 1.0:
            for broken in self._giving_way(loads.ratio, worst):
                self._log(
                    self._structure.members.names[broken],
                    JOINT_KINDS[self._structure.members.kind[broken]],
                    float(loads.ratio[broken]),
                    (time_s, cargo_mass),
                )
                self._loads.holds[broken] = False
            self.landing = None
            self._fall_apart(engine)

    def _evaluated(self, engine: Engine, thrusts: FloatArray) -> tuple[JointLoads, FloatArray]:
        """Loads of the joints, and tensions of the ropes."""
        tensions = engine.rope_tensions()
        forces = self._forces(engine, thrusts, tensions)
        # An impact is reported for one interval only, whatever was left out before.
        seen_s = self._interval_s if engine.struck else self._unseen_s
        loads = self._loads.evaluate(
            forces,
            self.motion,
            elapsed_s=self._unseen_s,
            seen_s=seen_s,
            **self._blow(),
        )
        return loads, tensions

    def _blow(self) -> dict[str, float]:
        """How the loads of the last interval count, if the cargo landed in it."""
        if self.landing is None or not self.landing.counts:
            return {}
        return {"filter_s": BLOW_FILTER_S, "fading": self.landing.fading}

    def _is_blow(self, loads: JointLoads, tensions: FloatArray) -> bool:
        """Whether a joint or rope would break by a load that has risen all at once."""
        now = self._shares(loads.ratio, tensions)
        return bool((now > np.maximum(1.0, _BLOW * self._loads_now)).any())

    def _shares(self, ratio: FloatArray, tensions: FloatArray) -> FloatArray:
        """Share of its strength that each joint and rope bears."""
        ropes = np.maximum(tensions, 0.0) / GRAVITY / self._structure.ropes.limit
        return np.concatenate([ratio, ropes])

    def let_go(self, engine: Engine, members: IntArray, *, time_s: float) -> BoolArray:
        """Opens joints that are made to let go; no break.

        Args:
            engine: The engine, which is given new bodies if the machine comes apart.
            members: (D,) the joints.
            time_s: Time now, seconds.

        Returns:
            (D,) which of them held until now.
        """
        held = self._loads.holds[members]
        self._loads.holds[members] = False
        for member in members[held]:
            joint = self._structure.members.names[member]
            self.events.append(Event(time_s=round(time_s, 6), what="decoupled", joint=joint))
        if held.any():
            self._fall_apart(engine)
        return held

    def all_events(self) -> tuple[Event, ...]:
        """Releases and grabs so far, in order of time."""
        holds = [] if self.holding is None else self.holding.events
        return tuple(sorted([*self.events, *holds], key=lambda event: event.time_s))

    def _giving_way(self, ratio: FloatArray, worst: int) -> list[int]:
        """The worst joint and, where it is a connector, those that overload its face with it.

        One after the other, a stack of connectors would outlast its strength by its number.
        """
        member, _, face = self._structure.members.ends.T
        mates = member[np.isin(face, face[member == worst])]
        tied = mates[ratio[mates] >= ratio[worst] * (1.0 - 1e-6)]
        return [worst, *(int(mate) for mate in np.unique(tied) if mate != worst)]

    def taken_loads(self) -> FloatArray:
        """The largest share of its strength that each joint and rope bore since the last call.

        Where all evaluations since were left out, what it was found to bear last.
        """
        seen, self._loads_since = self._loads_since, None
        return self._loads_now if seen is None else seen

    def _follow_loads(self, ratio: FloatArray, tensions: FloatArray) -> None:
        now = self._loads_now = self._shares(ratio, tensions)
        self._loads_since = now if self._loads_since is None else np.maximum(self._loads_since, now)

    def peaks(self) -> tuple[JointPeak, ...]:
        """The largest load of every joint and rope so far."""
        members, ropes = self._structure.members, self._structure.ropes
        joints = [
            JointPeak(
                joint=name,
                kind=JOINT_KINDS[kind],
                force=round(float(force), 3),
                moment=round(float(moment), 3),
                ratio=round(float(ratio), 5),
            )
            for name, kind, (force, moment, ratio) in zip(
                members.names, members.kind, self._peaks.T, strict=True
            )
        ]
        winches = [
            JointPeak(
                joint=name,
                kind="rope",
                force=round(float(tension), 3),
                moment=0.0,
                ratio=round(float(tension / limit), 5),
            )
            for name, tension, limit in zip(ropes.names, self._rope_peaks, ropes.limit, strict=True)
        ]
        return (*joints, *winches)

    def _forces(self, engine: Engine, thrusts: FloatArray, tensions: FloatArray) -> PointForces:
        """Contacts, thrust and ropes together, each where the structure takes it."""
        clusters, motion = self.clusters, self.motion
        cargo = engine.cargo() if self._has_cargo else None
        faces = self._faces.find(clusters, motion, cargo)
        contacts = faces.joined_to(self._contacts(engine, cargo), clusters.cluster_of)
        others = [self._pushes(thrusts)] if len(thrusts) else []
        if len(tensions):
            others.append(self._pulls(tensions))
        if self.holding is not None:
            others.append(self.holding.forces(clusters, motion))
        if self._field is not None:
            others.append(self._field.taken(clusters, motion))
        settled = self._supports.settled(
            contacts,
            self._sharing.shared(contacts),
            corners=faces.corners,
            structure=self._loads,
            motion=motion,
            others=others,
        )
        self.bearing.read(settled.other, settled.surface, settled.forces)
        if self.holding is not None:
            self.bearing.add_held(*self.holding.lifts())
        return together([settled.forces, *others])

    def _contacts(self, engine: Engine, cargo: CargoPose | None) -> ContactForces:
        """The engine's contacts, with what the cargo's bounce adds to them."""
        contacts, before = engine.contacts(), self._cargo_before
        if before is None or cargo is None:
            return contacts
        self.landing = landing_of(
            contacts,
            before,
            cargo,
            so_far=self._landed,
            mass=self._cargo_mass,
            machine_mass=self._machine_mass,
            gravity=self._gravity,
            interval_s=self._interval_s,
        )
        if self.landing is None or not self.landing.counts:
            return contacts
        return replace(contacts, force=self.landing.stress * contacts.force)

    def _pushes(self, thrusts: FloatArray) -> PointForces:
        structure, motion = self._structure, self.motion
        cannons = structure.cannons
        c = self.clusters.cluster_of[cannons]
        turn = motion.rotation[c]
        return PointForces(
            block=cannons,
            point=motion.position[c] + turned(turn, structure.thrust_points),
            force=-thrusts[:, None] * turned(turn, structure.directions[cannons]),
        )

    def _pulls(self, tensions: FloatArray) -> PointForces:
        ropes = self._structure.ropes
        start, end = rope_ends(self._structure, self.clusters, self.motion)
        pull = end - start
        pull *= (tensions / np.maximum(np.linalg.norm(pull, axis=1), 1e-9))[:, None]
        return PointForces(
            block=np.concatenate([ropes.first, ropes.second]),
            point=np.concatenate([start, end]),
            force=np.concatenate([pull, -pull]),
        )

    def _break_ropes(
        self, engine: Engine, tensions: FloatArray, time_s: float, cargo_mass: float | None
    ) -> None:
        ropes = self._structure.ropes
        pull = tensions / GRAVITY
        self._rope_peaks = np.maximum(self._rope_peaks, pull)
        for r in (self._rope_holds & (pull > ropes.limit)).nonzero()[0]:
            self._rope_holds[r] = False
            engine.drop_rope(int(r))
            self._log(ropes.names[r], "rope", float(pull[r] / ropes.limit[r]), (time_s, cargo_mass))

    def _log(self, joint: str, kind: str, ratio: float, when: tuple[float, float | None]) -> None:
        time_s, cargo_mass = when
        self.breaks.append(
            Break(
                time_s=round(time_s, 6),
                joint=joint,
                kind=kind,
                ratio=round(ratio, 5),
                cargo_mass=None if cargo_mass is None else round(cargo_mass, 6),
            )
        )

    def _enter(self, clusters: Clusters) -> None:
        self.clusters = clusters
        self._sharing = EvenSharing(clusters.cluster_of)
        self._supports = EdgeSupports(
            self._structure.centers_of_mass, clusters.cluster_of, gravity=GRAVITY
        )

    def _fall_apart(self, engine: Engine) -> None:
        before = self.clusters
        after = find_clusters(self._structure, self._loads.holds)
        if not _same(before, after):
            self.motion = self.motion.after_break(before, after)
            self._enter(after)
            engine.enter(after, self.motion)
        self._loads.rebuild(after, self.motion)


def _same(before: Clusters, after: Clusters) -> bool:
    return (
        len(before) == len(after)
        and bool((before.cluster_of == after.cluster_of).all())
        and bool((before.joint == after.joint).all())
    )
