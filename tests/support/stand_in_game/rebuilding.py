"""From a machine file's blocks to a machine our simulation takes: who sits on whose face."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from buildarena_geometry import Block, Connector, Machine, Pose, load_catalogue
from buildarena_geometry.blocks import JOINT_REACH, FaceRef
from buildarena_geometry.documents.log import LoggedState
from buildarena_geometry.state import MachineState, SubStructure
from stand_in_game.frames import Array, our_rotation, quaternion, swapped, world_axes
from stand_in_game.machine_file import BALLAST, CONNECTORS, FileBlock, FileMachine

TYPES: Final[Mapping[int, str]] = {
    0: "Starting Block",
    2: "Powered Wheel",
    7: "Brace",
    15: "Small Wooden Block",
    45: "Winch",
    47: "Torch",
    56: "Water Cannon",
}
"""The types the stand-in has physics for, besides the cargo."""

_KEYS: Final = {
    "spinning_forward": "bmt-forward",
    "spinning_backward": "bmt-backward",
    "hold_to_fire": "bmt-shoot",
}
ALWAYS: Final = "always"
"""A key that is held from start to end: that of a wheel which drives by itself."""

_SAME: Final = 1e-3
"""Units, and 1 - cosine: files write seven digits or more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rebuilt:
    """A machine made of a file's blocks.

    Attributes:
        machine: blocks and connectors; their ids are their places in the file, counted from 0.
        keys: the keys of each block's actions, in the order of the machine's blocks.
        cargo: the place of the cargo in the file; None without one.
        left_out: places of blocks the stand-in has no physics for.
    """

    machine: Machine
    keys: list[dict[str, tuple[str, ...]]]
    cargo: int | None
    left_out: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class _Face:
    ref: FaceRef
    center: Array
    normal: Array
    is_root: bool


def rebuild(file: FileMachine) -> Rebuilt:
    """The machine of a file's blocks, in the file's machine frame.

    A block sits on the face whose centre its root is at and whose normal it points along; failing
    that, on the nearest such face that the game would still join it to.
    """
    bare = {
        str(place): _bare(place, block)
        for place, block in enumerate(file.blocks)
        if block.type_id in TYPES and block.type_id not in CONNECTORS
    }
    mounted = _mounted(bare)
    ordered = {key: mounted[key] for key in bare}
    faces = [face for block in ordered.values() for face in _faces(block)]
    connectors = {}
    left_out = [p for p, b in enumerate(file.blocks) if b.type_id not in {*TYPES, BALLAST}]
    for place, block in enumerate(file.blocks):
        if block.type_id in CONNECTORS:
            link = _connector(place, block, faces)
            if link is None:
                left_out.append(place)
            else:
                connectors[link.id] = link
    cargo = [place for place, block in enumerate(file.blocks) if block.type_id == BALLAST]
    state = MachineState(
        catalogue=load_catalogue(),
        blocks=ordered,
        connectors=connectors,
        occupants={b.mount: b.id for b in ordered.values() if b.mount is not None},
        structures={
            block.id: SubStructure(letter=block.id, source="file", root=block.id)
            for block in ordered.values()
            if block.module.kind == "start"
        },
        next_id=len(file.blocks) + 1,
    )
    return Rebuilt(
        machine=Machine.restored(LoggedState(state=state, records=(), available={})),
        keys=[_keys(file.blocks[int(block)]) for block in ordered],
        cargo=cargo[0] if cargo else None,
        left_out=tuple(sorted([*left_out, *cargo[1:]])),
    )


def _bare(place: int, block: FileBlock) -> Block:
    rotation = our_rotation(block.type_id, block.rotation)
    return Block(
        id=str(place),
        module=load_catalogue()[TYPES[block.type_id]],
        world_from_block=Pose(position=swapped(block.position), quaternion=quaternion(rotation)),
        flipped=block.flipped,
    )


def _keys(block: FileBlock) -> dict[str, tuple[str, ...]]:
    keys = {action: block.keys(entry) for action, entry in _KEYS.items() if block.keys(entry)}
    if block.data.get("bmt-automatic") is True:
        keys["spinning_forward"] = (*keys.get("spinning_forward", ()), ALWAYS)
    return keys


def _faces(block: Block) -> list[_Face]:
    return [
        _Face(
            (block.id, face.label),
            np.array(block.face_center(face.label)),
            np.array(block.face_normal(face.label)),
            face.label == block.module.root_face,
        )
        for face in block.module.faces
    ]


def _mounted(bare: Mapping[str, Block]) -> dict[str, Block]:
    """The blocks with the faces they sit on, found outwards from the starting blocks."""
    mounted = {key: block for key, block in bare.items() if block.module.kind == "start"}
    waiting = {key: block for key, block in bare.items() if key not in mounted}
    taken: set[FaceRef] = set()
    while waiting:
        grown = _grow(mounted, waiting, taken, _SAME) or _grow(
            mounted, waiting, taken, JOINT_REACH + _SAME
        )
        if not grown:
            # Nothing of the rest touches what is reached: another piece, which falls by itself.
            loose = _root_of(waiting)
            mounted[loose] = waiting.pop(loose)
    return mounted


def _root_of(waiting: Mapping[str, Block]) -> str:
    """A block that sits on none of the others, or simply the first."""
    faces = [face for block in waiting.values() for face in _faces(block)]
    for key, block in waiting.items():
        others = [f for f in faces if f.ref[0] != key and not f.is_root]
        if _best(block, others, _SAME) is None:
            return key
    return next(iter(waiting))


def _grow(
    mounted: dict[str, Block], waiting: dict[str, Block], taken: set[FaceRef], reach: float
) -> bool:
    grown = False
    frontier = list(mounted.values())
    while frontier:
        faces = [
            face
            for block in frontier
            for face in _faces(block)
            if face.ref not in taken and not (face.is_root and block.mount is not None)
        ]
        frontier = []
        for key, block in list(waiting.items()):
            face = _best(block, [f for f in faces if f.ref not in taken], reach)
            if face is not None:
                taken.add(face.ref)
                mounted[key] = replace(block, mount=face.ref)
                frontier.append(mounted[key])
                del waiting[key]
                grown = True
        if grown and reach > _SAME:
            # What was just found may hold others exactly, and exact places go first.
            return True
    return grown


def _best(block: Block, faces: Iterable[_Face], reach: float) -> _Face | None:
    root, out = np.array(block.world_from_block.xyz), np.array(block.axis_xyz)
    near = [
        (float(np.linalg.norm(face.center - root)), face)
        for face in faces
        if face.normal @ out > 1 - _SAME
    ]
    within = [(gap, face) for gap, face in near if gap <= reach]
    return min(within, key=lambda pair: pair[0])[1] if within else None


def _connector(place: int, block: FileBlock, faces: list[_Face]) -> Connector | None:
    """A brace or winch between the faces its ends are at; None where there are none."""
    span = np.array(block.vector("end-position") or (0.0, 0.0, 0.0))
    axes, start = world_axes(block.rotation), swapped(block.position)
    first = _end(start, axes[:, 2], faces)
    second = _end(start + axes @ span, _end_normal(block), faces)
    if first is None or second is None or first.ref == second.ref:
        return None
    module = load_catalogue()[TYPES[block.type_id]]
    rotation = our_rotation(block.type_id, block.rotation)
    return Connector(
        id=str(place),
        module=module,
        start=first.ref,
        end=second.ref,
        start_xyz=_plain(first.center),
        end_xyz=_plain(second.center),
        world_from_connector=Pose(position=start, quaternion=quaternion(rotation)),
        span=_plain(rotation.T @ (axes @ span)),
    )


def _end_normal(block: FileBlock) -> Array | None:
    """The way the end's face looks, by its ZYZ angles; files may leave them out."""
    angles = block.vector("end-rotation")
    if angles is None:
        return None
    alpha, beta, _ = np.radians(np.array(angles) - np.array([270.0, 0.0, 0.0]))
    looking = [np.sin(beta) * np.cos(alpha), np.sin(beta) * np.sin(alpha), np.cos(beta)]
    return swapped(looking)


def _end(point: Array, normal: Array | None, faces: list[_Face]) -> _Face | None:
    """The face nearest a point; of faces at one place, the one that looks the way told."""
    gaps = np.array([np.linalg.norm(face.center - point) for face in faces])
    if not len(gaps) or gaps.min() > JOINT_REACH:
        return None
    here = [faces[k] for k in np.flatnonzero(gaps <= gaps.min() + _SAME)]
    if normal is None:
        return here[0]
    return max(here, key=lambda face: float(face.normal @ normal))


def _plain(vector: Array) -> tuple[float, float, float]:
    x, y, z = (float(part) for part in vector)
    return (x, y, z)
