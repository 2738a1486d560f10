"""Faces of blocks' refs and of connectors' ends, derived from positions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_besiege.exporting.entries import end_rotation
from buildarena_besiege.importing.blocks import Part
from buildarena_geometry.blocks import JOINT_REACH
from buildarena_geometry.rotations import Vector

_TOUCHING: Final = 1e-3  # units; a root so near to a face's centre sits on it
_ALIGNED: Final = 0.9995  # cosine; a block's axis is the normal of the face it sits on
_ALIKE: Final = 1e-3  # of quaternions
_NEAR: Final = JOINT_REACH + _TOUCHING

FaceRef = tuple[int, str]
"""Index of a block in the list, and the label of one of its faces."""


@dataclass(frozen=True, slots=True)
class Faces:
    """The faces of all blocks: (F, 3) centres and normals, world frame, and whose they are."""

    refs: tuple[FaceRef, ...]
    centers: NDArray[np.float64]
    normals: NDArray[np.float64]


def faces_of(parts: Sequence[Part]) -> Faces:
    """Return the faces of some blocks."""
    refs, centers, normals = [], [], []
    for i, part in enumerate(parts):
        for face in part.module.faces:
            refs.append((i, face.label))
            centers.append(part.pose.point(face.center))
            normals.append(part.pose.direction(face.normal))
    return Faces(tuple(refs), np.array(centers).reshape(-1, 3), np.array(normals).reshape(-1, 3))


def mounts_of(parts: Sequence[Part], faces: Faces) -> list[FaceRef | None]:
    """Return the face that each block sits on; None for starting blocks and unattached blocks.

    Blocks that touch a face come first, then those at a distance that the game would still join. A
    face carries one block, and no block sits on itself in a cycle.

    Args:
        parts: Blocks without connectors.
        faces: Faces of the blocks.
    """
    mounts: list[FaceRef | None] = [None] * len(parts)
    occupied: set[FaceRef] = set()
    # A block that itself sits nowhere may carry another on the face it once sat by.
    for reach, roots in ((_TOUCHING, False), (_NEAR, False), (_TOUCHING, True)):
        for i, part in enumerate(parts):
            if part.module.kind == "start" or mounts[i] is not None or not len(faces.refs):
                continue
            if (i, part.module.root_face) in occupied:
                continue
            for ref in _candidates(part, faces, reach):
                base = ref[0]
                by_root = ref[1] == parts[base].module.root_face
                open_ = not by_root or (roots and mounts[base] is None)
                if open_ and ref not in occupied and not _carries(mounts, i, base):
                    mounts[i] = ref
                    occupied.add(ref)
                    break
    return mounts


def ends_of(
    link: Part, parts: Sequence[Part], faces: Faces
) -> tuple[FaceRef | None, FaceRef | None]:
    """Return the faces at a connector's start and end; None where none is near.

    Among faces at the same position, the file's frames of its ends decide.

    Args:
        faces: Faces of the blocks.
    """
    begin, end = link.pose.point(link.start), link.pose.point(link.end)
    return (
        _nearest(begin, faces, lambda ref: _same_frame(link, parts, ref)),
        _nearest(end, faces, lambda ref: _same_rotation(link, parts, ref)),
    )


def _candidates(part: Part, faces: Faces, reach: float) -> list[FaceRef]:
    distance = np.linalg.norm(faces.centers - np.array(part.pose.xyz), axis=1)
    axis = np.array(part.pose.direction((0.0, 0.0, 1.0)))
    fitting = np.flatnonzero((distance <= reach) & (faces.normals @ axis >= _ALIGNED))
    ordered = sorted(fitting.tolist(), key=lambda i: (round(float(distance[i]), 6), i))
    return [faces.refs[i] for i in ordered]


def _carries(mounts: list[FaceRef | None], part: int, base: int) -> bool:
    """Check if the base already sits, directly or not, on the part."""
    at: FaceRef | None = (base, "")
    while at is not None:
        if at[0] == part:
            return True
        at = mounts[at[0]]
    return False


def _nearest(point: Vector, faces: Faces, fits: Callable[[FaceRef], bool]) -> FaceRef | None:
    if not len(faces.refs):
        return None
    distance = np.linalg.norm(faces.centers - np.array(point), axis=1)
    shortest = float(distance.min())
    if shortest > _NEAR:
        return None
    nearest = [faces.refs[i] for i in np.flatnonzero(distance <= shortest + _TOUCHING)]
    return next((ref for ref in nearest if fits(ref)), nearest[0])


def _same_frame(link: Part, parts: Sequence[Part], ref: FaceRef) -> bool:
    part, label = parts[ref[0]], ref[1]
    face = part.pose @ part.module.face_of_label[label].block_from_face
    cosine = sum(a * b for a, b in zip(face.wxyz, link.pose.wxyz, strict=True))
    return abs(cosine) > 1.0 - _ALIKE


def _same_rotation(link: Part, parts: Sequence[Part], ref: FaceRef) -> bool:
    if link.end_rotation is None:
        return False
    part, label = parts[ref[0]], ref[1]
    theirs = end_rotation(part.pose @ part.module.face_of_label[label].block_from_face)
    left, right = _half_angles(theirs), _half_angles(link.end_rotation)
    return abs(sum(a * b for a, b in zip(left, right, strict=True))) > 1.0 - _ALIKE


def _half_angles(angles: Vector) -> tuple[float, float, float, float]:
    """Return the quaternion of ZYZ angles, so that angles of equal rotations compare equal."""
    first, tilt, last = (math.radians(angle) / 2 for angle in (angles[0] - 270.0, *angles[1:]))
    cosine, sine = math.cos(tilt), math.sin(tilt)
    return (
        cosine * math.cos(first + last),
        sine * math.sin(last - first),
        sine * math.cos(last - first),
        cosine * math.sin(first + last),
    )
