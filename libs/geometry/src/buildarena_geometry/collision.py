"""Finds overlapping blocks. The only module that uses FCL."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache

import fcl
import numpy as np

from buildarena_geometry.blocks import Block
from buildarena_geometry.modules.solids import Ball, Box, Cylinder, Solid
from buildarena_geometry.poses import Pose

TOUCHING = 1e-6  # units; solids that reach into each other less than this touch, which is allowed
_ALL_CONTACTS = 1_000_000  # limit of FCL's broadphase; more than any machine has


@dataclass(frozen=True, slots=True)
class Overlap:
    """Two blocks that reach into each other.

    Attributes:
        block: id of the block that was tested.
        other: id of the block that it reaches into.
        depth: greatest penetration depth, units.
    """

    block: str
    other: str
    depth: float


class CollisionWorld:
    """The solids of a machine's blocks in FCL's dynamic tree of bounding boxes.

    Every block that is placed, moved or removed is entered here, so that a question costs what the
    moved blocks' surroundings cost and not what the machine costs.
    """

    __slots__ = ("_objects", "_owners", "_tree")

    def __init__(self) -> None:
        """Create an empty world."""
        self._tree = fcl.DynamicAABBTreeCollisionManager()
        self._tree.setup()
        # FCL's contacts name geometries, so each block has its own, mapped by `_owners`.
        self._objects: dict[str, list[tuple[fcl.CollisionObject, fcl.CollisionGeometry]]] = {}
        self._owners: dict[int, str] = {}

    def overlaps(self, blocks: Iterable[Block]) -> list[Overlap]:
        """Return the pairs of blocks that would overlap with these blocks at their poses.

        The given blocks are tested against the world's other blocks, not against each other: they
        are one block, or move together as one rigid body.

        Args:
            blocks: new blocks, or blocks of the world at new poses.

        Returns:
            Each pair once, in the order of the given blocks and then in that in which the world's
            were placed.
        """
        candidates = list(blocks)
        moving = {block.id for block in candidates}
        overlaps: list[Overlap] = []
        for block in candidates:
            depths: dict[str, float] = {}
            for solid in block.module.colliders:
                for other, depth in self._touched_by(solid, block.world_from_block):
                    if other not in moving:
                        depths[other] = max(depth, depths.get(other, 0.0))
            touched = [other for other in self._objects if other in depths] if depths else ()
            overlaps += [Overlap(block.id, other, depths[other]) for other in touched]
        return overlaps

    def place(self, blocks: Iterable[Block]) -> None:
        """Add blocks, or move those it already contains to their current poses."""
        for block in blocks:
            objects = self._objects.get(block.id)
            if objects is None:
                self._add(block)
                continue
            for solid, (placed, _) in zip(block.module.colliders, objects, strict=True):
                placed.setTransform(_transform(solid, block.world_from_block))
                self._tree.update(placed)

    def remove(self, ids: Iterable[str]) -> None:
        """Remove blocks; ids that it does not contain, such as connectors', are ignored."""
        for block in ids:
            for placed, geometry in self._objects.pop(block, ()):
                self._tree.unregisterObject(placed)
                del self._owners[id(geometry)]

    def become(self, before: Mapping[str, Block], after: Mapping[str, Block]) -> None:
        """Change from one state's blocks to another's, at a cost proportional to the difference.

        Args:
            before: blocks that it contains.
            after: blocks to contain, in the order in which they count as placed.
        """
        self.remove(before.keys() - after.keys())
        self.place(block for key, block in after.items() if before.get(key) is not block)
        if list(self._objects) != list(after):
            self._objects = {key: self._objects[key] for key in after}

    def _add(self, block: Block) -> None:
        objects = []
        for solid in block.module.colliders:
            geometry = _geometry(solid)
            placed = fcl.CollisionObject(geometry, _transform(solid, block.world_from_block))
            self._owners[id(geometry)] = block.id
            self._tree.registerObject(placed)
            objects.append((placed, geometry))
        self._objects[block.id] = objects

    def _touched_by(self, solid: Solid, world_from_block: Pose) -> Iterator[tuple[str, float]]:
        request = fcl.CollisionRequest(num_max_contacts=_ALL_CONTACTS, enable_contact=True)
        collisions = fcl.CollisionData(request, fcl.CollisionResult())
        probe = fcl.CollisionObject(_probe(solid), _transform(solid, world_from_block))
        self._tree.collide(probe, collisions, fcl.defaultCollisionCallback)
        for contact in collisions.result.contacts:
            if contact.penetration_depth >= TOUCHING:
                # One side is the probe, which no block owns.
                owner = self._owners.get(id(contact.o1)) or self._owners[id(contact.o2)]
                yield owner, contact.penetration_depth


def unwanted(overlaps: Iterable[Overlap], blocks: Mapping[str, Block]) -> list[Overlap]:
    """Return the overlaps that no module has by design.

    Args:
        overlaps: pairs of blocks that overlap.
        blocks: all blocks by id, including those of the pairs, at their overlapping poses.
    """
    return [
        overlap
        for overlap in overlaps
        if not _reaches_into(blocks[overlap.block], blocks[overlap.other])
        and not _reaches_into(blocks[overlap.other], blocks[overlap.block])
    ]


def _reaches_into(block: Block, other: Block) -> bool:
    return block.module.overlaps_base and block.mount is not None and block.mount[0] == other.id


def _geometry(solid: Solid) -> fcl.CollisionGeometry:
    if isinstance(solid, Box):
        return fcl.Box(*solid.size)
    if isinstance(solid, Ball):
        return fcl.Sphere(solid.radius)
    return fcl.Cylinder(solid.radius, solid.length)


@cache
def _probe(solid: Solid) -> fcl.CollisionGeometry:
    """Return a solid's shared geometry for queries; only blocks of the world need their own."""
    return _geometry(solid)


@cache
def _block_from_solid(solid: Solid) -> Pose:
    """Return a solid's pose; FCL's solids are centered, with a cylinder's axis along z."""
    return solid.block_from_axis if isinstance(solid, Cylinder) else Pose(position=solid.center)


def _transform(solid: Solid, world_from_block: Pose) -> fcl.Transform:
    pose = world_from_block @ _block_from_solid(solid)
    return fcl.Transform(np.array(pose.wxyz), np.array(pose.xyz))
