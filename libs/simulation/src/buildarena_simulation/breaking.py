"""Breaking: the worst joint over its strength gives way, one per evaluation."""

from collections.abc import Callable
from typing import Final

import numpy as np

from buildarena_simulation.acting import Acted, Interval, Surrounded
from buildarena_simulation.constants import BLOW_FILTER_S, GRAVITY, LOAD_FILTER_S
from buildarena_simulation.engines.base import Engine, World
from buildarena_simulation.holding import Holding
from buildarena_simulation.landing import Landing
from buildarena_simulation.structure.clusters import Clusters, find_clusters
from buildarena_simulation.structure.loads import JointLoads, LoadModel
from buildarena_simulation.structure.model import (
    JOINT_KINDS,
    BoolArray,
    FloatArray,
    IntArray,
    Members,
    Structure,
)
from buildarena_simulation.structure.motion import Motion
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
        holding: What blocks hold; None where none can.

    Attributes:
        landing: How the cargo lands on the machine; None if it does not, or if something broke.
        bearing: What bears the machine, and what it bears; see `Acted`.
        on_blocks: What ground and terrain exert on each block; see `Acted`.
    """

    def __init__(
        self, world: World, clusters: Clusters, motion: Motion, holding: Holding | None
    ) -> None:
        structure = self._structure = world.structure
        self.clusters, self.motion, self._holding = clusters, motion, holding
        self._around = Surrounded(world, holding)
        self._around.enter(structure, clusters)
        self._loads = LoadModel(structure, clusters, motion, gravity=world.even_gravity)
        self._rope_holds = np.ones(len(structure.ropes), dtype=bool)
        self._unseen_s, self._calm = 0.0, False
        self._borne = self._peaks = np.zeros((3, len(structure.members) + len(structure.ropes)))
        self._since: FloatArray | None = None
        self.bearing = np.zeros(len(world.terrain) + 2 + len(structure.wheels))
        self.on_blocks = np.zeros(len(structure))
        self.landing: Landing | None = None
        self.breaks: list[Break] = []
        self._events: list[Event] = []

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
        self._structure = structure
        self._loads.weigh(structure)
        self._enter(engine, find_clusters(structure, self.holds))

    def follow(
        self,
        engine: Engine,
        motion: Motion,
        interval: Interval,
        repeat_finer: Callable[[], Motion] | None = None,
    ) -> None:
        """Evaluates the loads after one interval and breaks what is overloaded.

        Args:
            engine: The engine, which is given new bodies if the machine falls apart.
            motion: The clusters' motion now.
            interval: What it began with.
            repeat_finer: Repeats the interval in finer steps and says how the clusters move then;
                None where it cannot be repeated.
        """
        self.motion, self.landing = motion, None
        self._unseen_s += interval.length_s
        if self._calm and not engine.struck and interval.landing is None:
            self._calm = False
            return
        filters = self._loads.filters()
        acted, borne = self._evaluated(engine, interval)
        if repeat_finer is not None and _is_blow(self._borne, borne):
            self._loads.put_back(filters)
            self.motion = repeat_finer()
            acted, borne = self._evaluated(engine, interval)
            engine.enter(self.clusters, self.motion)
        self.landing, self.bearing, self.on_blocks = acted.landing, acted.bearing, acted.on_blocks
        self._unseen_s, self._borne = 0.0, borne
        self._peaks = np.maximum(self._peaks, borne)
        self._since = borne[2] if self._since is None else np.maximum(self._since, borne[2])
        count = len(self.holds)
        self._calm = bool(borne[2, :count].max(initial=0.0) < _CALM) and not engine.struck
        for rope in (self._rope_holds & (borne[2, count:] > 1.0)).nonzero()[0]:
            self._rope_holds[rope] = False
            engine.drop_rope(int(rope))
            self._log(count + int(rope), interval)
        giving_way = giving_way_together(borne[2, :count], self._structure.members)
        if giving_way:
            for member in giving_way:
                self._log(member, interval)
            self.holds[giving_way] = False
            self.landing = None
            self._fall_apart(engine)

    def let_go(self, engine: Engine, members: IntArray, *, time_s: float) -> BoolArray:
        """Opens joints that are made to let go; no break.

        Args:
            engine: The engine, which is given new bodies if the machine comes apart.
            members: (D,) the joints.
            time_s: Time now, seconds.

        Returns:
            (D,) which of them held until now.
        """
        held = self.holds[members]
        self.holds[members] = False
        for member in members[held]:
            joint = self._structure.members.names[member]
            self._events.append(Event(time_s=round(time_s, 6), what="decoupled", joint=joint))
        if held.any():
            self._fall_apart(engine, released=True)
        return held

    def all_events(self) -> tuple[Event, ...]:
        """Releases and grabs so far, in order of time."""
        holds = [] if self._holding is None else self._holding.events
        return tuple(sorted([*self._events, *holds], key=lambda event: event.time_s))

    def taken_loads(self) -> FloatArray:
        """The largest share of its strength that each joint and rope bore since the last call.

        Where all evaluations since were left out, what it was found to bear last.
        """
        seen, self._since = self._since, None
        return self._borne[2] if seen is None else seen

    def peaks(self) -> tuple[JointPeak, ...]:
        """The largest load of every joint and rope so far."""
        return tuple(
            JointPeak(
                joint=name,
                kind=kind,
                force=round(force, 3),
                moment=round(moment, 3),
                ratio=round(ratio, 5),
            )
            for (name, kind), (force, moment, ratio) in zip(
                _joints(self._structure), self._peaks.T.tolist(), strict=True
            )
        )

    def _evaluated(self, engine: Engine, interval: Interval) -> tuple[Acted, FloatArray]:
        """What acted in the interval, and what each joint and rope bears of it."""
        tensions = engine.rope_tensions()
        acted = self._around.acted(engine, interval, self.motion, tensions, self._loads)
        landing = acted.landing if acted.landing is not None and acted.landing.counts else None
        loads = self._loads.evaluate(
            acted.forces,
            self.motion,
            elapsed_s=self._unseen_s,
            # An impact is reported for one interval only, whatever was left out before.
            seen_s=interval.length_s if engine.struck else self._unseen_s,
            filter_s=LOAD_FILTER_S if landing is None else BLOW_FILTER_S,
            fading=1.0 if landing is None else landing.fading,
        )
        return acted, _borne(loads, tensions, self._structure.ropes.limit)

    def _log(self, joint: int, interval: Interval) -> None:
        mass = interval.cargo_mass
        name, kind = _joints(self._structure)[joint]
        self.breaks.append(
            Break(
                time_s=round(interval.end_s, 6),
                joint=name,
                kind=kind,
                ratio=round(float(self._borne[2, joint]), 5),
                cargo_mass=None if mass is None else round(mass, 6),
            )
        )

    def _fall_apart(self, engine: Engine, *, released: bool = False) -> None:
        after = find_clusters(self._structure, self.holds)
        if _same(self.clusters, after):
            self._loads.rebuild(after, self.motion)
        else:
            self._enter(engine, after, released=released)

    def _enter(self, engine: Engine, after: Clusters, *, released: bool = False) -> None:
        self.motion = self.motion.after_break(self.clusters, after)
        self.clusters = after
        self._around.enter(self._structure, after)
        engine.enter(after, self.motion)
        self._loads.rebuild(after, self.motion, released=released)


def giving_way_together(ratio: FloatArray, members: Members) -> list[int]:
    """The worst joint over its strength and, if a connector, those that overload its face with it.

    One after the other, a stack of connectors would outlast its strength by its number.

    Args:
        ratio: (M,) share of its strength that each joint bears.
        members: The joints.

    Returns:
        Their numbers, the worst first; none where all are strong enough.
    """
    if not (ratio > 1.0).any():
        return []
    worst = int(np.argmax(ratio))
    member, _, face = members.ends.T
    mates = member[np.isin(face, face[member == worst])]
    tied = mates[ratio[mates] >= ratio[worst] * (1.0 - 1e-6)]
    return [worst, *(int(mate) for mate in np.unique(tied) if mate != worst)]


def _borne(loads: JointLoads, tensions: FloatArray, limits: FloatArray) -> FloatArray:
    """(3, M + R) force, moment and share of its strength that each joint and each rope bears."""
    pulls = np.maximum(tensions, 0.0) / GRAVITY
    ropes = np.array([pulls, np.zeros(len(pulls)), pulls / limits])
    return np.concatenate([[loads.force, loads.moment, loads.ratio], ropes], axis=1)


def _is_blow(before: FloatArray, now: FloatArray) -> bool:
    """Whether a joint or rope would break by a load that has risen all at once; see `_borne`."""
    return bool((now[2] > np.maximum(1.0, _BLOW * before[2])).any())


def _joints(structure: Structure) -> list[tuple[str, str]]:
    """Name and kind of each joint, then of each rope."""
    members = structure.members
    joints = [(name, JOINT_KINDS[k]) for name, k in zip(members.names, members.kind, strict=True)]
    return [*joints, *((rope, "rope") for rope in structure.ropes.names)]


def _same(before: Clusters, after: Clusters) -> bool:
    return (
        len(before) == len(after)
        and bool((before.cluster_of == after.cluster_of).all())
        and bool((before.joint == after.joint).all())
    )
