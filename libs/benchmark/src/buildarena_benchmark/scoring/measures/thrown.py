"""Release, flight and landing of a loose ball."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series, rotations
from buildarena_geometry import Block, Machine
from buildarena_geometry.modules.solids import Ball, Cylinder, Solid
from buildarena_simulation import Scenario, Trajectory
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.structure.model import Shape
from buildarena_simulation.terrain import shape_of

TOUCH: Final = 0.12
"""A ball this near to something touches it: bodies are a little smaller to engines, units."""
HELD: Final = 0.2
"""A ball this near to a part is held by it, units: on a gripper's seat there is a gap of 0.146."""

_FEWEST: Final = 3
"""Least samples in the air for a flight: its velocity is that between the first two."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Flight:
    """A ball's way from the machine to the first thing it touches. Samples count from 0.

    Attributes:
        released: Last sample at which it touched the machine.
        landed: First sample at which it touches ground or terrain.
        start: (3,) place at the sample after the release, units.
        velocity: (3,) its velocity there, units/s.
        end: (3,) place of its centre when it touches down, units.
        error: Largest deviation from a free flight with that beginning, as a share of its way.
    """

    released: int
    landed: int
    start: Series
    velocity: Series
    end: Series
    error: float


def loose_ball(machine: "Machine", trajectory: "Trajectory") -> int | None:
    """Return the index of the first tracked block that is a loose ball; None if there is none."""
    for index, name in enumerate(trajectory.block_ids):
        module = machine.blocks[name].module
        if module.is_loose and isinstance(module.body[0], Ball):
            return index
    return None


def radius_of(run: Run, ball: int) -> float:
    """Return the radius of a ball among the tracked blocks, units."""
    body = run.machine.blocks[run.trajectory.block_ids[ball]].module.body
    return next(solid.radius for solid in body if isinstance(solid, Ball))


def gaps_to_parts(run: Run, ball: int) -> Series:
    """Return the gap from a ball to each tracked block, (T, N), units; infinite to itself."""
    center = run.positions[:, ball]
    gaps = distances_to_parts(run, center) - radius_of(run, ball)
    gaps[:, ball] = np.inf
    return gaps


def distances_to_parts(run: Run, center: Series) -> Series:
    """Return the distance of a moving point, (T, 3), to each block, (T, N), units; 0 inside."""
    gaps = np.full(run.trajectory.positions.shape[:2], np.inf)
    for column, name in enumerate(run.trajectory.block_ids):
        block = run.machine.blocks[name]
        turns = rotations(run.trajectory.quaternions[:, column])
        offset = center - run.positions[:, column]
        local = np.einsum("tji,tj->ti", turns, offset) + np.array(block.module.center)
        for solid in block.module.body:
            gaps[:, column] = np.minimum(gaps[:, column], _distances(solid, local))
    return gaps


def gap_to_world(scenario: "Scenario", center: Series, radius: float) -> Series:
    """Return the gap from a ball with centres (T, 3) to ground and terrain, (T,), units."""
    gap = center[:, 2].copy()
    for shape in map(shape_of, scenario.terrain):
        gap = np.minimum(gap, _box_distances(shape, center))
    return gap - radius


def flight_of(run: Run, ball: int, gaps: Series) -> Flight | None:
    """Return how a ball flew until it first touched ground or terrain; None if it did not."""
    block = run.machine.blocks[run.trajectory.block_ids[ball]]
    path = run.positions[:, ball]
    radius = radius_of(run, ball)
    down = np.flatnonzero(gap_to_world(run.scenario, path, radius) <= TOUCH)
    landed = int(down[0]) if len(down) else 0
    touched = np.flatnonzero(gaps.min(axis=1)[:landed] <= HELD)
    if not len(touched) or landed - int(touched[-1]) - 1 < _FEWEST:
        return None
    released = int(touched[-1])
    first, last, step = released + 1, landed - 1, 1.0 / SAMPLE_RATE_HZ
    drag = _drag(block)
    velocity = _velocity(path[first], path[first + 1], step, run.scenario.gravity, drag)
    free = _fly(path[first], velocity, (last - first) * step, run.scenario.gravity, drag)
    way = max(float(np.linalg.norm(path[last] - path[first])), 1e-9)
    return Flight(
        released=released,
        landed=landed,
        start=path[first],
        velocity=velocity,
        end=_touch_point(path, landed, radius, run.scenario.gravity),
        error=float(np.linalg.norm(path[last] - free)) / way,
    )


def _touch_point(path: Series, landed: int, radius: float, gravity: float) -> Series:
    """Return where its centre is when it first touches, between two samples, (3,), units."""
    before, step = path[landed - 1], 1.0 / SAMPLE_RATE_HZ
    velocity = (before - path[landed - 2]) / step - np.array([0.0, 0.0, gravity * step / 2])
    fall = velocity[2] ** 2 + 2.0 * gravity * (before[2] - radius)
    time_s = (velocity[2] + np.sqrt(max(fall, 0.0))) / gravity
    if not 0.0 <= time_s <= step:  # it touches a side or a top before the ground
        return np.asarray(path[landed])
    return np.asarray(before + velocity * time_s - np.array([0.0, 0.0, gravity * time_s**2 / 2]))


def _drag(block: "Block") -> float:
    return 0.0 if block.module.physics is None else block.module.physics.linear_drag


def _fly(start: Series, velocity: Series, time_s: float, gravity: float, drag: float) -> Series:
    """Return where a free ball is after a time: v' = -drag v - g, (3,), units."""
    down = np.array([0.0, 0.0, -gravity])
    if drag == 0.0:
        return np.asarray(start + velocity * time_s + down * time_s**2 / 2)
    lasting = -np.expm1(-drag * time_s) / drag
    return np.asarray(start + velocity * lasting + down * (time_s - lasting) / drag)


def _velocity(start: Series, after: Series, time_s: float, gravity: float, drag: float) -> Series:
    """Return the velocity with which a free ball gets from start to end in a time, (3,)."""
    still = _fly(start, np.zeros(3), time_s, gravity, drag)
    lasting = time_s if drag == 0.0 else -np.expm1(-drag * time_s) / drag
    return np.asarray((after - still) / lasting)


def _distances(solid: "Solid", points: Series) -> Series:
    """Return distances of points (T, 3) to a solid, both in its block's frame, units; 0 inside."""
    if isinstance(solid, Cylinder):
        pose = solid.block_from_axis
        local = (points - np.array(pose.position)) @ np.array(pose.rotation)
        along = np.maximum(np.abs(local[:, 2]) - solid.length / 2, 0.0)
        across = np.maximum(np.hypot(local[:, 0], local[:, 1]) - solid.radius, 0.0)
        return np.asarray(np.hypot(along, across))
    local = points - np.array(solid.center)
    if isinstance(solid, Ball):
        return np.asarray(np.maximum(np.linalg.norm(local, axis=1) - solid.radius, 0.0))
    return _outside(local, np.array(solid.size) / 2)


def _box_distances(shape: Shape, points: Series) -> Series:
    return _outside((points - shape.center) @ shape.rotation, shape.half_extents)


def _outside(local: Series, half: Series) -> Series:
    return np.asarray(np.linalg.norm(np.maximum(np.abs(local) - half, 0.0), axis=1))
