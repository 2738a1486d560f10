"""Gear trains between the base and the part that holds the cargo."""

from collections.abc import Collection, Iterator
from typing import Final

import numpy as np

from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import rotations
from buildarena_geometry.modules.joints import MOVING_JOINTS
from buildarena_simulation.constants import JointKind
from buildarena_simulation.machine import structure_of
from buildarena_simulation.structure.clusters import connected_components, find_clusters
from buildarena_simulation.structure.model import JOINT_KINDS, Structure

LARGE_RADIUS: Final = 1.5
"""Smallest pitch radius of a large gear wheel, units."""

_NEAR: Final = 0.75
"""Largest distance from a cargo's centre of what holds it without a gripper, units: half a block,
and a quarter."""

_TURNING: Final = (JOINT_KINDS.index(JointKind.AXLE), JOINT_KINDS.index(JointKind.HINGE))
_COLLINEAR: Final = 1e-3


def gear_turn_deg(run: Run, driven: Collection[str], *, first: int, last: int) -> float | None:
    """Return the turning of the large gear wheel through which the cargo was raised, degrees.

    Such a wheel is driven through teeth, by others if need be, and lies between the starting block
    and what holds the cargo: with its axle opened, and what turns about the same line, nothing
    joins the two, and the wheel is joined to the cargo's side. Its turning is seen from what it is
    mounted on.

    Args:
        run: Has a cargo.
        driven: The blocks whose motors were commanded to turn.
        first: Sample from which the turning counts.
        last: Sample up to which it counts, and at which the cargo's holders are determined.

    Returns:
        The most of all such wheels; None without one.
    """
    structure = structure_of(run.machine)
    ids = structure.block_ids
    holders = [ids.index(block) for block in _holders(run, last)]
    start = ids.index(run.trajectory.block_ids[run.start])
    turns = [
        _turn_deg(run, ids[wheel], ids[mount], first, last)
        for wheel, mount, axle in _driven_wheels(structure, {ids.index(b) for b in driven})
        if _lies_between(structure, wheel, axle, start, holders)
    ]
    return max(turns, default=None)


def _holders(run: Run, sample: int) -> list[str]:
    """Return the grippers that hold the cargo at a sample; without any, the blocks touching it."""
    holding: set[str] = set()
    for event in run.trajectory.events:
        if event.time_s <= run.time_s[sample] and event.held == "cargo":
            (holding.add if event.what == "grabbed" else holding.discard)(event.joint)
    if holding:
        return [block for block in run.machine.blocks if block in holding]
    offset = run.positions[sample] - run.cargo_path[sample]
    outside = np.maximum(np.abs(offset @ run.cargo_turns[sample]) - run.cargo_size / 2, 0.0)
    distances = np.linalg.norm(outside, axis=1)
    holders = np.flatnonzero(distances <= max(_NEAR, float(distances.min())))
    return [run.trajectory.block_ids[block] for block in holders]


def _driven_wheels(structure: "Structure", driven: set[int]) -> Iterator[tuple[int, int, int]]:
    """Return large gear wheels that turn with motors: the wheel, its mounting block, its axle."""
    clusters = find_clusters(structure, np.ones(len(structure.members), dtype=bool)).cluster_of
    members = structure.members
    axles = {
        int(members.second[k]): k
        for k in range(len(members))
        if JOINT_KINDS[members.kind[k]] in MOVING_JOINTS
        and clusters[members.first[k]] != clusters[members.second[k]]
    }
    reached, grown = {i for i in driven if i in axles}, True
    while grown:
        turning = {
            other
            for mesh in structure.joints.meshes
            for cog, other in ((mesh.first, mesh.second), (mesh.second, mesh.first))
            if cog in reached and other in axles
        }
        bodies = {clusters[i] for i in reached}
        turning |= {i for i in axles if clusters[i] in bodies}
        grown = not turning <= reached
        reached |= turning
    in_mesh = {i for mesh in structure.joints.meshes for i in (mesh.first, mesh.second)}
    for i in sorted(reached & in_mesh - driven):
        gear = structure.parts[i].module.gear
        if gear is not None and gear.pitch_radius >= LARGE_RADIUS:
            yield i, int(members.first[axles[i]]), axles[i]


def _lies_between(
    structure: "Structure", wheel: int, axle: int, start: int, holders: list[int]
) -> bool:
    """Return whether opening a wheel's axle parts it and the cargo's holder from the start."""
    members, ropes = structure.members, structure.ropes
    opened = {k for k in range(len(members)) if k == axle or _same_line(structure, k, axle)}
    edges = [
        (int(members.first[k]), int(members.second[k]))
        for k in range(len(members))
        if k not in opened
    ]
    edges += zip(ropes.first.tolist(), ropes.second.tolist(), strict=True)
    pieces = connected_components(len(structure), edges)
    base = next(piece for piece in pieces if start in piece)
    beyond = next(piece for piece in pieces if wheel in piece)
    return beyond is not base and bool(holders) and set(holders) <= set(beyond)


def _same_line(structure: "Structure", k: int, other: int) -> bool:
    """Return whether two joints turn about the same line."""
    members, joints = structure.members, structure.joints
    if members.kind[k] not in _TURNING:
        return False
    first, second = members.second[[k, other]]
    offset = joints.points[second] - joints.points[first]
    axis = joints.axes[second]
    return bool(
        np.linalg.norm(np.cross(joints.axes[first], axis)) < _COLLINEAR
        and np.linalg.norm(np.cross(offset, axis)) < _COLLINEAR
    )


def _turn_deg(run: Run, wheel: str, mount: str, first: int, last: int) -> float:
    """Return the greatest angle by which a wheel is turned from its first orientation, degrees."""
    rows = slice(first, last + 1)
    columns = [run.trajectory.block_ids.index(block) for block in (mount, wheel)]
    base, turned = (rotations(run.trajectory.quaternions[rows, column]) for column in columns)
    relative = np.einsum("tji,tjk->tik", base, turned)
    cosine = (np.einsum("tij,ij->t", relative, relative[0]) - 1.0) / 2.0
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))).max(initial=0.0))
