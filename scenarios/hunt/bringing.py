"""Checks of machines that throw a boulder or bring a ball."""

import numpy as np
from scenarios.hunt.evidence import Evidence, Floats, path_of

from buildarena_benchmark.scoring.measures.thrown import loose_ball


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
