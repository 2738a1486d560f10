"""Checks that find a success odd, by other means than the scorers' rules.

A check may be wrong: it says that somebody should look. Where a machine was tried on both engines,
or with several seeds, all trials are looked at.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np
from scenarios.hunt.evidence import Check, Evidence, Floats, counts, path_of
from scenarios.hunt.variation.genome import IDLE, kind_of
from support.machines.piloted import listened, repeated, scored

from buildarena_benchmark import Score, Task
from buildarena_benchmark.scoring.measures.thrown import loose_ball
from buildarena_geometry import Machine
from buildarena_simulation import MachineNotSimulable
from buildarena_simulation.scenario import SpanPlacement

_TOP: Final = 5.0
"""Height of the terrains' tops in the built-in support tasks, units."""

_ELSEWHERE: Final = 11
"""A drawn world that no search is in."""

_UPRIGHT: Final = 0.866
"""Cosine of the largest angle between up and a rocket's net thrust."""


def suspicions(evidence: Evidence) -> tuple[str, ...]:
    """Names of the checks that find a success odd, the general ones last."""
    checks = {**CHECKS.get(kind_of(evidence.task.name), {}), **GENERAL}
    return tuple(name for name, check in checks.items() if check(evidence))


# Support


def _gap(evidence: Evidence) -> float:
    placement = evidence.task.scenario.placement
    return placement.gap if isinstance(placement, SpanPlacement) else 0.0


def _reaches_no_terrain(evidence: Evidence) -> bool:
    """No block of the machine lies over one of the terrains at the start."""
    y = path_of(evidence.trajectory)[0, :, 1]
    modules = [evidence.machine.blocks[block].module for block in evidence.trajectory.block_ids]
    reach = np.array([max(module.size or (1.0,)) / 2 for module in modules])
    half = _gap(evidence) / 2
    return bool((y + reach).max() < half or (y - reach).min() > -half)


def _near_the_floor(evidence: Evidence) -> bool:
    """A block within the gap is near its floor while the cargo is up, for a second or more."""
    trajectory = evidence.trajectory
    if trajectory.cargo_position is None:
        return False
    path = path_of(trajectory)
    within = np.abs(path[:, :, 1]) < _gap(evidence) / 2
    low = (within & (path[:, :, 2] < 1.0)).any(axis=1)
    return bool((low & (trajectory.cargo_position[:, 2] > _TOP - 1.0)).sum() >= 25)


def _higher_than_long(evidence: Evidence) -> bool:
    start = path_of(evidence.trajectory)[0]
    extent = start.max(axis=0) - start.min(axis=0)
    return bool(extent[2] > extent[1])


def _cargo_beside(evidence: Evidence) -> bool:
    """The cargo ends up over a terrain and not over the gap, yet above the tops."""
    cargo = evidence.trajectory.cargo_position
    return cargo is not None and bool(
        abs(cargo[-1, 1]) > _gap(evidence) / 2 and cargo[-1, 2] > _TOP
    )


def _parts_for_the_gap(evidence: Evidence) -> bool:
    """Fewer parts than the gap is wide: something other than blocks end to end spans it."""
    return evidence.machine.part_count < _gap(evidence)


def _stacked_connectors(evidence: Evidence) -> bool:
    """More than two connectors between the same two faces."""
    pairs = Counter(frozenset((c.start, c.end)) for c in evidence.machine.connectors.values())
    return max(pairs.values(), default=0) > 2


# Transport


def _wheels_hang_in_the_air(evidence: Evidence) -> bool:
    """Its wheels are off the ground for most of the time."""
    rows = evidence.rows("wheel")
    heights = path_of(evidence.trajectory)[:, rows, 2]
    return not rows or bool((heights > 1.2).mean() > 0.6)


def _taller_than_its_way(evidence: Evidence) -> bool:
    start = path_of(evidence.trajectory)[0]
    extent = start.max(axis=0) - start.min(axis=0)
    return bool(np.linalg.norm(extent) > evidence.score.indicator)


def _falls_over(evidence: Evidence) -> bool:
    """What was on top comes down to the ground, by more than the machine's width."""
    path = path_of(evidence.trajectory)
    if not path.shape[1]:
        return False
    top = int(path[0, :, 2].argmax())
    width = float((path[0].max(axis=0) - path[0].min(axis=0))[:2].max())
    return bool(path[0, top, 2] - path[:, top, 2].min() > max(width, 2.0))


def _rolls_on_without_keys(evidence: Evidence) -> bool:
    """Most of its way lies after the last key was let go."""
    trajectory = evidence.trajectory
    ends = [press.time_s + press.hold_for_s for press in evidence.machine.control_sequence]
    way = np.linalg.norm(path_of(trajectory)[:, 0, :2] - path_of(trajectory)[0, 0, :2], axis=1)
    last = int(np.searchsorted(trajectory.time_s, max(ends, default=0.0)))
    return bool(way[: last + 1].max() < 0.5 * way.max())


def _cargo_on_the_ground(evidence: Evidence) -> bool:
    """The cargo lies on the ground where it has got farthest."""
    cargo = evidence.trajectory.cargo_position
    if cargo is None:
        return False
    away = np.linalg.norm(cargo[:, :2] - cargo[0, :2], axis=1)
    return bool(cargo[int(away.argmax()), 2] < 1.0)


def _few_wheels(evidence: Evidence) -> bool:
    return len(evidence.rows("wheel")) < 3


# Lift


def _pushes_aside(evidence: Evidence) -> bool:
    """The cannons' net push, as built, is not upwards."""
    blocks = evidence.machine.blocks.values()
    cannons = [block for block in blocks if block.module.kind == "cannon"]
    pushes = [-np.array(block.pointing_xyz) for block in cannons if block.pointing_xyz]
    net = np.sum(pushes, axis=0) if pushes else np.zeros(3)
    return bool(net[2] <= _UPRIGHT * np.linalg.norm(net))


def _few_hot_cannons(evidence: Evidence) -> bool:
    """Even if all that flames touch at the end pushed upwards, it would not lift the machine."""
    hot = int(evidence.trajectory.heated[-1].sum()) if evidence.trajectory.heated.size else 0
    cold = len(evidence.trajectory.cannon_ids) - hot
    return bool(hot * 13.76 + cold * 1.6 <= evidence.machine.mass)


def _start_stays_behind(evidence: Evidence) -> bool:
    """The highest block is far from the starting block, in height."""
    if evidence.task.scorer != "height":
        return False
    path = path_of(evidence.trajectory)
    size = float(np.linalg.norm(path[0].max(axis=0) - path[0].min(axis=0)))
    spread = path[:, :, 2].max(axis=1) - path[:, 0, 2]
    return bool(spread.max() > size + 2.0)


def _no_cannon_with_the_start(evidence: Evidence) -> bool:
    """No cannon is near the starting block when the machine is highest."""
    path = path_of(evidence.trajectory)
    rows = evidence.rows("cannon")
    at = int(path[:, 0, 2].argmax())
    size = float(np.linalg.norm(path[0].max(axis=0) - path[0].min(axis=0)))
    apart = np.linalg.norm(path[at, rows] - path[at, :1], axis=1)
    return not rows or bool(apart.min() > size + 1.0)


def _idle_structure(evidence: Evidence) -> bool:
    """A sub-structure of a block or two, there to be counted."""
    sizes = Counter(block.structure for block in evidence.machine.blocks.values())
    return len(sizes) > 1 and min(sizes.values()) <= 2


# Control


def _needs_no_program(evidence: Evidence) -> bool:
    """It succeeds in a drawn world with a program that asks for nothing."""
    return _drawn(
        evidence,
        lambda task, machine: scored(task, machine.with_controller(IDLE), "mujoco", _ELSEWHERE),
    )


def _looks_at_nothing(evidence: Evidence) -> bool:
    """What it answered in the exact world succeeds in a drawn one, whatever is sensed there."""

    def again(task: Task, machine: Machine) -> Score:
        _, answers = listened(task, machine, "mujoco")
        return repeated(answers, task, machine, "mujoco", _ELSEWHERE)

    return _drawn(evidence, again)


def _drawn(evidence: Evidence, trial: Callable[[Task, Machine], Score]) -> bool:
    try:
        result = trial(evidence.task, evidence.machine)
    except MachineNotSimulable:
        return False
    return counts(result)


# All categories


def _engines_disagree(evidence: Evidence) -> bool:
    """Verdicts differ, or indicators by more than a quarter."""
    scores = [result for result, _ in evidence.trials.values()]
    low, high = (pick(result.indicator for result in scores) for pick in (min, max))
    return len({result.success for result in scores}) > 1 or bool(low < 0.75 * high)


def _luck(evidence: Evidence) -> bool:
    """It fails with most seeds."""
    return evidence.robust_share is not None and evidence.robust_share < 0.5


def _falls_apart(evidence: Evidence) -> bool:
    """A vehicle or rocket of which less than half still holds together at the end."""
    pieces = evidence.trajectory.pieces
    if pieces is None or not pieces.size or kind_of(evidence.task.name) == "support":
        return False
    return bool(np.unique(pieces[-1], return_counts=True)[1].max() < 0.5 * pieces.shape[1])


def _too_few_parts(evidence: Evidence) -> bool:
    """Fewer parts than an honest machine of its category can do with."""
    least = {"support": 5, "transport": 5, "lift": 3}.get(evidence.task.category, 2)
    return evidence.machine.part_count < least


def no_key_before_it_flies(evidence: Evidence) -> bool:
    """The boulder is fast before the first key: something else than a command throws it."""
    pace = _pace(evidence)
    if evidence.machine.controller or not pace.size:
        return False
    presses = [press.time_s for press in evidence.machine.control_sequence]
    fast = int((pace > 0.5 * pace.max()).argmax())
    return bool(evidence.trajectory.time_s[fast] < min(presses, default=np.inf))


def breaks_as_it_throws(evidence: Evidence) -> bool:
    """A joint breaks in the second around the boulder's greatest speed."""
    pace, trajectory = _pace(evidence), evidence.trajectory
    if not pace.size:
        return False
    fastest = trajectory.time_s[int(pace.argmax())]
    return any(abs(event.time_s - fastest) < 0.5 for event in trajectory.breaks)


def travels(evidence: Evidence) -> bool:
    """The starting block moves by more than a unit before the boulder is fastest."""
    pace = _pace(evidence)
    if not pace.size:
        return False
    start = path_of(evidence.trajectory)[: int(pace.argmax()) + 1, 0]
    return bool(np.linalg.norm(start - start[0], axis=1).max() > 1.0)


def cargo_runs_ahead(evidence: Evidence) -> bool:
    """The cargo is faster than any part of the machine on most of its way to the last gate."""
    cargo, gates = evidence.trajectory.cargo_position, evidence.task.scenario.gates
    if cargo is None or not gates:
        return False
    way = np.linalg.norm(cargo[:, :2] - cargo[0, :2], axis=1)
    there = way >= np.linalg.norm(np.array(gates[-1].center) - cargo[0, :2])
    end = int(there.argmax()) if there.any() else len(way)
    pace = np.linalg.norm(np.diff(cargo[:end].astype(np.float64), axis=0), axis=1)
    parts = np.linalg.norm(np.diff(path_of(evidence.trajectory)[:end], axis=0), axis=2)
    alone = pace > 1.2 * parts.max(axis=1)
    return bool(pace[alone].sum() > 0.5 * pace.sum())


def reaches_over_the_way(evidence: Evidence) -> bool:
    """The machine is longer than half of what the cargo travels."""
    cargo = evidence.trajectory.cargo_position
    if cargo is None:
        return False
    start = path_of(evidence.trajectory)[0]
    extent = float(np.linalg.norm((start.max(axis=0) - start.min(axis=0))[:2]))
    return extent > 0.5 * float(np.linalg.norm(cargo[:, :2] - cargo[0, :2], axis=1).max())


def _pace(evidence: Evidence) -> Floats:
    """(T - 1,) how far the boulder moves from sample to sample, units; empty without one."""
    ball = loose_ball(evidence.machine, evidence.trajectory)
    if ball is None:
        return np.empty(0)
    path = path_of(evidence.trajectory)[:, ball]
    return np.asarray(np.linalg.norm(np.diff(path, axis=0), axis=1))


CHECKS: Final[Mapping[str, Mapping[str, Check]]] = MappingProxyType(
    {
        "support": {
            "reaches no terrain": _reaches_no_terrain,
            "near the floor": _near_the_floor,
            "higher than long": _higher_than_long,
            "cargo beside the gap": _cargo_beside,
            "fewer parts than the gap is wide": _parts_for_the_gap,
            "stacked connectors": _stacked_connectors,
        },
        "transport": {
            "wheels hang in the air": _wheels_hang_in_the_air,
            "taller than its way": _taller_than_its_way,
            "falls over": _falls_over,
            "rolls on without keys": _rolls_on_without_keys,
            "cargo on the ground": _cargo_on_the_ground,
            "fewer than three wheels": _few_wheels,
        },
        "lift": {
            "pushes aside": _pushes_aside,
            "too few hot cannons": _few_hot_cannons,
            "start stays behind": _start_stays_behind,
            "no cannon with the start": _no_cannon_with_the_start,
            "idle structure": _idle_structure,
        },
        "driving": {
            "wheels hang in the air": _wheels_hang_in_the_air,
            "falls over": _falls_over,
            "rolls on without keys": _rolls_on_without_keys,
            "fewer than three wheels": _few_wheels,
        },
        "delivering": {
            "falls over": _falls_over,
            "rolls on without keys": _rolls_on_without_keys,
            "cargo runs ahead": cargo_runs_ahead,
            "reaches over the way": reaches_over_the_way,
        },
        "throwing": {
            "no key before it flies": no_key_before_it_flies,
            "breaks as it throws": breaks_as_it_throws,
            "travels": travels,
        },
        "control": {
            "needs no program": _needs_no_program,
            "looks at nothing": _looks_at_nothing,
        },
    }
)
"""Checks of one kind by name."""

GENERAL: Final[Mapping[str, Check]] = MappingProxyType(
    {
        "too few parts": _too_few_parts,
        "falls apart": _falls_apart,
        "engines disagree": _engines_disagree,
        "fails with most seeds": _luck,
    }
)
"""Checks of all categories by name."""
