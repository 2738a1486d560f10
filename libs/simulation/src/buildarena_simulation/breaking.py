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

_MOST_SKIPPED: Final = 3
"""Greatest number of intervals in a row without an evaluation, of a machine that stands; 1 of one
that moves, whose parts turn meanwhile."""

_STANDS: Final = 0.5
"""Speed and spin below which a machine stands, units/s and rad/s."""

_SAFETY: Final = 8.0
"""Factor by which a load may change faster than it did, unseen, without losing joint or support."""

_NEGLIGIBLE: Final = 0.01
"""Share of all supports' loads below which a change of one is negligible: contacts flicker."""

_TINY: Final = 1e-6
"""Least change and room that are counted with, so that nothing is divided by zero."""

_BLOW: Final = 3.0
"""A load that rises by this factor from one evaluation to the next may be an error of the step."""


class BreakingModel:
    """Model of a machine's joint loads, under which joints break.

    While loads change slowly, nothing hits and no cannon starts or stops, up to three evaluations
    in a row are skipped: so many that no joint would break in between, and no support be lost, if
    its load went on eight times as fast as it last changed; at most one if the machine moves. The
    next evaluation counts for all that were skipped.

    A load that would break something after it rose threefold at once counts only if steps of half
    the length show it as well: engines make up blows now and then.

    Args:
        clusters: Its clusters at the start.
        motion: Their motion at the start.
        holding: Holds of blocks; None if no block can hold.

    Attributes:
        landing: Landing of the cargo on the machine; None if there is none, or if something broke.
        bearing: Supports of the machine, and its loads on them; see `Acted`.
        on_blocks: Upward force of ground and terrain on each block; see `Acted`.
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
        self._unseen_s, self._skippable = 0.0, 0
        self._thrusts = np.zeros(len(structure.cannons))
        self._last = self._peaks = np.zeros((3, len(structure.members) + len(structure.ropes)))
        self._since: FloatArray | None = None
        self.bearing = np.zeros(len(world.terrain) + 2 + len(structure.wheels))
        self.on_blocks = np.zeros(len(structure))
        self.landing: Landing | None = None
        self.breaks: list[Break] = []
        self._events: list[Event] = []

    def blow(self, wind: FloatArray) -> None:
        """Set the acceleration of masses besides even gravity from now on; see `LoadModel.wind`."""
        self._loads.wind = wind

    @property
    def holds(self) -> BoolArray:
        """True for each joint that holds, (M,)."""
        return self._loads.holds

    def weigh(self, engine: Engine, structure: Structure) -> None:
        """Update the masses of the machine.

        Args:
            engine: Engine, whose bodies are replaced.
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
        """Evaluate the loads after one interval and break the overloaded joints.

        Args:
            engine: Engine, whose bodies are replaced if the machine falls apart.
            interval: State at its beginning.
            repeat_finer: Function that repeats the interval in finer steps and returns the
                clusters' motion then; None if it cannot be repeated.
        """
        self.motion, self.landing = motion, None
        self._unseen_s += interval.length_s
        # A cannon that fires and stops between two evaluations would load no joint.
        sudden = engine.struck or bool((interval.thrusts != self._thrusts).any())
        self._thrusts = interval.thrusts
        landing = interval.landing is not None and not interval.landing.over
        if self._skippable > 0 and not sudden and not landing:
            self._skippable -= 1
            return
        filters = self._loads.filters()
        acted, loads = self._evaluated(engine, interval, sudden=sudden)
        if repeat_finer is not None and _is_blow(self._last, loads):
            self._loads.put_back(filters)
            self.motion = repeat_finer()
            acted, loads = self._evaluated(engine, interval, sudden=sudden)
            engine.enter(self.clusters, self.motion)
        seen, bearing = round(self._unseen_s / interval.length_s), acted.bearing
        room = np.abs(bearing) + _NEGLIGIBLE * np.abs(bearing).sum() + _TINY
        most = _MOST_SKIPPED if _stands(self.motion) else 1
        self._skippable = min(
            0 if sudden or landing else most,
            _skippable(loads[2] - self._last[2], 1.0 - loads[2], seen),
            _skippable(bearing - self.bearing, room, seen),
        )
        self.landing, self.bearing, self.on_blocks = acted.landing, bearing, acted.on_blocks
        self._unseen_s, self._last = 0.0, loads
        self._peaks = np.maximum(self._peaks, loads)
        self._since = loads[2] if self._since is None else np.maximum(self._since, loads[2])
        count = len(self.holds)
        for rope in (self._rope_holds & (loads[2, count:] > 1.0)).nonzero()[0]:
            self._rope_holds[rope] = False
            engine.drop_rope(int(rope))
            self._log(count + int(rope), interval)
        giving_way = giving_way_together(loads[2, :count], self._structure.members)
        if giving_way:
            for member in giving_way:
                self._log(member, interval)
            self.holds[giving_way] = False
            self.landing = None
            self._fall_apart(engine)

    def let_go(self, engine: Engine, members: IntArray, *, time_s: float) -> BoolArray:
        """Open joints that are built to release; this is not a break.

        Args:
            engine: Engine, whose bodies are replaced if the machine separates.
            members: (D,) indices of the joints.
            time_s: Time now, seconds.

        Returns:
            (D,) true for those that held until now.
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
        """Release and grabs so far, in order of time."""
        holds = [] if self._holding is None else self._holding.events
        return tuple(sorted([*self._events, *holds], key=lambda event: event.time_s))

    def take_loads(self) -> FloatArray:
        """Return each joint's and rope's largest load since the last call, as a share of strength.

        If all evaluations since were skipped, this is the last load found.
        """
        largest, self._since = self._since, None
        return self._last[2] if largest is None else largest

    def peaks(self) -> tuple[JointPeak, ...]:
        """Return the largest load of every joint and rope so far."""
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

    def _evaluated(
        self, engine: Engine, interval: Interval, *, sudden: bool
    ) -> tuple[Acted, FloatArray]:
        """Return the forces in the interval, and each joint's and rope's load from them."""
        tensions = engine.rope_tensions()
        acted = self._around.acted(engine, interval, self.motion, tensions, self._loads)
        landing = acted.landing if acted.landing is not None and acted.landing.counts else None
        loads = self._loads.evaluate(
            acted.forces,
            self.motion,
            elapsed_s=self._unseen_s,
            # What is sudden lasts for one interval only, whatever was left out before.
            seen_s=interval.length_s if sudden else self._unseen_s,
            filter_s=LOAD_FILTER_S if landing is None else BLOW_FILTER_S,
            fading=1.0 if landing is None else landing.fading,
        )
        return acted, _tabulate_loads(loads, tensions, self._structure.ropes.limit)

    def _log(self, joint: int, interval: Interval) -> None:
        mass = interval.cargo_mass
        name, kind = _joints(self._structure)[joint]
        self.breaks.append(
            Break(
                time_s=round(interval.end_s, 6),
                joint=name,
                kind=kind,
                ratio=round(float(self._last[2, joint]), 5),
                cargo_mass=None if mass is None else round(mass, 6),
            )
        )

    def _fall_apart(self, engine: Engine, *, released: bool = False) -> None:
        # What was skipped before it was like what was seen then.
        self._unseen_s, self._skippable = 0.0, 0
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
    """Return the worst overloaded joint and, if a connector, those that overload its face with it.

    One after the other, a stack of connectors would outlast its strength by its number.

    Args:
        ratio: (M,) load of each joint as a share of its strength.

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


def _tabulate_loads(loads: JointLoads, tensions: FloatArray, limits: FloatArray) -> FloatArray:
    """Return force, moment and share of strength for each joint and each rope, (3, M + R)."""
    pulls = np.maximum(tensions, 0.0) / GRAVITY
    ropes = np.array([pulls, np.zeros(len(pulls)), pulls / limits])
    return np.concatenate([[loads.force, loads.moment, loads.ratio], ropes], axis=1)


def _is_blow(before: FloatArray, now: FloatArray) -> bool:
    """Check if a joint or rope would break by a load that rose suddenly; see `_tabulate_loads`."""
    return bool((now[2] > np.maximum(1.0, _BLOW * before[2])).any())


def _stands(motion: Motion) -> bool:
    """Check if all parts of a machine are nearly at rest."""
    return bool(max(np.abs(motion.velocity).max(), np.abs(motion.spin).max()) < _STANDS)


def _skippable(change: FloatArray, room: FloatArray, intervals: int) -> int:
    """Return how many evaluations can be skipped.

    Args:
        change: Changes in a number of intervals.
        room: The further change that must not go unseen, of each.
    """
    safe = intervals * room / np.maximum(_SAFETY * np.abs(change), _TINY)
    return max(int(safe.min(initial=_MOST_SKIPPED)), 0)


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
