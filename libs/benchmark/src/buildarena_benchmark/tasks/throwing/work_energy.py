"""Bounds on the work of a machine's springs, drives and falling parts."""

import numpy as np

from buildarena_benchmark.scoring.measures.masses import masses_of_blocks
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series, rotations
from buildarena_geometry import Block
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.machine import structure_of
from buildarena_simulation.structure.model import Structure


def most_work(run: Run, ball: int, sample: int) -> float:
    """Return the most work that a machine can have done on a ball from the start on, mass·unit²/s².

    Args:
        run: All its blocks are tracked.
        sample: Up to which sample.
    """
    heights = run.positions[: sample + 1, :, 2]
    masses = masses_of_blocks(run)
    masses[ball] = 0.0
    fall = run.scenario.gravity * float(masses @ (heights[0] - heights[-1]))
    drives = run.scenario.drive_strength * _drives(run, sample)
    return max(fall, 0.0) + drives + _springs(run, sample)


def _drives(run: Run, sample: int) -> float:
    """Return each drive's force along all of its way, and the push of each decoupler."""
    base_of = {joint.part: joint.base for joint in run.machine.joints}
    index = {name: k for k, name in enumerate(run.trajectory.block_ids)}
    total = 0.0
    for name, block in run.machine.blocks.items():
        force = _drive_force(block)
        if force and name in base_of:
            way = _way(run, index[base_of[name]], index[name], sample)
            total += GRAVITY * force * way
        if block.module.decouple is not None:
            total += block.module.decouple.impulse**2 / block.module.mass
    return total


def _drive_force(block: "Block") -> float:
    """Return the most that a drive exerts, mass·g or mass·g·unit; 0 without one."""
    motor, joint = block.module.motor, block.module.joint
    if motor is not None:
        return motor.torque
    return joint.drive.force if joint is not None and joint.drive is not None else 0.0


def _way(run: Run, base: int, part: int, sample: int) -> float:
    """Return the way by which a block turned and slid on another in all, rad or units."""
    under = rotations(run.trajectory.quaternions[: sample + 1, base])
    turns = np.einsum(
        "tji,tjk->tik", under, rotations(run.trajectory.quaternions[: sample + 1, part])
    )
    steps = np.einsum("tji,tjk->tik", turns[:-1], turns[1:])
    angles = np.arccos(np.clip((np.trace(steps, axis1=1, axis2=2) - 1.0) / 2, -1.0, 1.0))
    places = run.positions[: sample + 1]
    offset = np.einsum("tji,tj->ti", under, places[:, part] - places[:, base])
    slides = np.linalg.norm(np.diff(offset, axis=0), axis=1)
    return max(float(angles.sum()), float(slides.sum()))


def _springs(run: Run, sample: int) -> float:
    """Return what springs give while they draw together, and while they push apart again."""
    structure = structure_of(run.machine)
    ropes, total = structure.ropes, 0.0
    for spring, row in zip(ropes.spring_of, ropes.springs, strict=True):
        ends = [
            _path(run, structure, int(block), point)[: sample + 1]
            for block, point in (
                (ropes.first[row], ropes.first_point[row]),
                (ropes.second[row], ropes.second_point[row]),
            )
        ]
        length = np.linalg.norm(ends[1] - ends[0], axis=1)
        shortest = spring.shortest if spring.contract else 1.0
        pulled = np.maximum(length - shortest * ropes.length[row], 0.0) ** 2
        pushed = np.maximum(ropes.length[row] - length, 0.0) ** 2
        released = sum(
            float(np.maximum(-np.diff(square), 0.0).sum()) for square in (pulled, pushed)
        )
        total += float(ropes.stiffness[row]) / 2 * released
    return total


def _path(run: Run, structure: Structure, block: int, point: Series) -> Series:
    """Return the path of a point of a block, given in the machine's frame, (T, 3), world frame."""
    local = structure.rotations[block].T @ (point - structure.shown[block])
    turned = rotations(run.trajectory.quaternions[:, block]) @ local
    return np.asarray(run.positions[:, block] + turned)
