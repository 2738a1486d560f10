"""Everything a machine is at one moment, as a value.

Actions never change a state: they make the next one. So a refused action leaves no trace by
construction, and feedback can be put into words long after the machine has moved on.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from buildarena_geometry.blocks import Block, Connector, FaceRef, Joint, KeyPress
from buildarena_geometry.modules.module import Catalogue
from buildarena_geometry.modules.solids import Ball, Box, Solid
from buildarena_geometry.poses import Pose
from buildarena_geometry.reading import Form
from buildarena_geometry.rotations import Vector, subtract


class SubStructure(Form, frozen=True, kw_only=True):
    """One machine inside an assembly.

    Attributes:
        letter: the prefix of its blocks' ids.
        source: the key of the machine it is a copy of.
        root: id of its starting block.
    """

    letter: str
    source: str
    root: str


def sub_structure_letter(count: int) -> str:
    """The letter of the sub-structure before which so many were added: A to Z, then AA, AB."""
    letters = ""
    count += 1
    while count:
        count, digit = divmod(count - 1, 26)
        letters = chr(ord("A") + digit) + letters
    return letters


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineState:
    """A machine at one moment; its mappings are never changed once they are in a state.

    Attributes:
        catalogue: the modules it may be made of.
        available: the machines an assembly may be made of, by name, as states.
        blocks: by id, in the order of creation.
        connectors: by id, in the order of creation.
        occupants: the id of the block that sits on a face, by that face.
        structures: an assembly's sub-structures by letter.
        structures_made: how many letters have been given out.
        control_sequence: in the order of entry.
        controller: the program that acts in place of the control sequence; "" without one.
        next_id: the number the next block or connector gets.
    """

    catalogue: Catalogue
    available: Mapping[str, MachineState] = field(default_factory=dict)
    blocks: Mapping[str, Block] = field(default_factory=dict)
    connectors: Mapping[str, Connector] = field(default_factory=dict)
    occupants: Mapping[FaceRef, str] = field(default_factory=dict)
    structures: Mapping[str, SubStructure] = field(default_factory=dict)
    structures_made: int = 0
    control_sequence: tuple[KeyPress, ...] = ()
    controller: str = ""
    next_id: int = 1

    @property
    def started(self) -> bool:
        """Whether there is a starting block."""
        return bool(self.blocks)

    @property
    def is_assembly(self) -> bool:
        """Whether it is built from whole machines instead of from a starting block."""
        return bool(self.available)

    @property
    def parts(self) -> tuple[Block | Connector, ...]:
        """All blocks, then all connectors."""
        return (*self.blocks.values(), *self.connectors.values())

    @property
    def mass(self) -> float:
        """Mass of all blocks and connectors, mass units."""
        return math.fsum(part.mass for part in self.parts)

    @property
    def cost(self) -> int:
        """Besiege's price of all blocks and connectors."""
        return sum(part.module.cost for part in self.parts)

    @property
    def center_of_mass(self) -> NDArray[np.float64]:
        """(3,) world frame, units; blocks count at their centers, connectors at their middles.

        Raises:
            ValueError: the machine is empty.
        """
        if not self.started:
            raise ValueError("an empty machine has no center of mass")
        masses = [part.mass for part in self.parts]
        center: NDArray[np.float64] = np.average(self._centers, axis=0, weights=masses)
        return center

    @property
    def _centers(self) -> NDArray[np.float64]:
        points = [block.center for block in self.blocks.values()]
        points += [(link.start_point + link.end_point) / 2 for link in self.connectors.values()]
        return np.array(points)

    @property
    def inertia(self) -> NDArray[np.float64]:
        """(3,) moments of inertia about axes through the center of mass along the world's.

        Blocks count as solid boxes of their outer dimensions, connectors as points.
        """
        masses = np.array([part.mass for part in self.parts])
        squares = (self._centers - self.center_of_mass) ** 2
        for place, block in enumerate(self.blocks.values()):
            extents = np.array([_extent(block, solid) for solid in block.module.body])
            if len(extents):
                squares[place] += np.ptp(extents, axis=(0, 1)) ** 2 / 12
        x, y, z = masses @ squares
        return np.array([y + z, x + z, x + y])

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) smallest and largest coordinates of the blocks' bodies, world frame, units.

        Raises:
            ValueError: the machine is empty.
        """
        if not self.started:
            raise ValueError("an empty machine has no bounds")
        blocks = self.blocks.values()
        extents = np.array(
            [_extent(block, solid) for block in blocks for solid in block.module.body]
        )
        return np.array([extents[:, 0].min(axis=0), extents[:, 1].max(axis=0)])

    def is_occupied(self, block: Block, label: str) -> bool:
        """Whether a face of the block is in use by an attachment, its own or another block's."""
        if (block.id, label) in self.occupants:
            return True
        return block.mount is not None and label == block.module.root_face

    def free_faces(self, block: Block) -> list[str]:
        """The labels of a block's faces that take another block."""
        labels = block.module.face_of_label
        return [label for label in labels if not self.is_occupied(block, label)]

    def children(self, block: Block) -> list[Block]:
        """The blocks that sit on a block."""
        children = (self.occupants.get((block.id, face.label)) for face in block.module.faces)
        return [self.blocks[child] for child in children if child is not None]

    def joint(self, part: Block) -> Joint | None:
        """What holds a block to the face it sits on; None where it sits on none."""
        if part.mount is None:
            return None
        base, label = part.mount
        face = self.blocks[base].face_center(label)
        root = part.seat_xyz
        return Joint(
            base=base,
            part=part.id,
            face=label,
            part_xyz=root,
            base_xyz=face,
            offset=math.dist(root, face),
        )

    def joints(self) -> Iterator[Joint]:
        """What holds the blocks together, in the order of the blocks."""
        for block in self.blocks.values():
            joint = self.joint(block)
            if joint is not None:
                yield joint

    def detached(self, joints: Iterable[Joint]) -> tuple[str, ...]:
        """Ids of the blocks from which no joint that holds and no connector leads to the first.

        Args:
            joints: this state's joints.
        """
        if not self.blocks:
            return ()
        neighbours: dict[str, list[str]] = {block: [] for block in self.blocks}
        held = [(joint.base, joint.part) for joint in joints if joint.holds]
        tied = [link.ends for link in self.connectors.values()]
        for left, right in (*held, *tied):
            neighbours[left].append(right)
            neighbours[right].append(left)
        frontier = [next(iter(self.blocks))]
        reached = set(frontier)
        while frontier:
            for neighbour in neighbours[frontier.pop()]:
                if neighbour not in reached:
                    reached.add(neighbour)
                    frontier.append(neighbour)
        return tuple(block for block in self.blocks if block not in reached)

    def members(self, letter: str) -> list[Block]:
        """The blocks of a sub-structure, those attached to it later included."""
        return [block for block in self.blocks.values() if block.structure == letter]

    def keys_in_use(self) -> tuple[str, ...]:
        """The keys that are bound to some action, in the order of the blocks."""
        bound = (key for part in self.powered() for keys in part.bindings.values() for key in keys)
        return tuple(dict.fromkeys(bound))

    def powered(self) -> tuple[Block | Connector, ...]:
        """The blocks, then the connectors, that take keys."""
        return tuple(part for part in self.parts if part.module.actions)

    def with_connector(self, link: Connector) -> MachineState:
        """The state in which this connector is new or different."""
        return replace(self, connectors={**self.connectors, link.id: link})

    def with_blocks(self, *changed: Block) -> MachineState:
        """The state in which these blocks are new or different, and connectors on them follow."""
        blocks = {**self.blocks, **{block.id: block for block in changed}}
        connectors = follow(self.connectors, blocks, {block.id for block in changed})
        return replace(self, blocks=blocks, connectors=connectors)


def follow(
    connectors: Mapping[str, Connector], blocks: Mapping[str, Block], moved: AbstractSet[str]
) -> Mapping[str, Connector]:
    """The connectors with their ends where the faces they sit on are now.

    Args:
        connectors: before the move.
        blocks: after the move.
        moved: ids of the blocks that moved.
    """
    touched = [link for link in connectors.values() if not moved.isdisjoint(link.ends)]
    if not touched:
        return connectors
    followed = dict(connectors)
    for link in touched:
        followed[link.id] = replace(
            link,
            start_xyz=blocks[link.start[0]].face_center(link.start[1]),
            end_xyz=blocks[link.end[0]].face_center(link.end[1]),
        )
    return followed


def moved_connector(link: Connector, motion: Pose) -> Connector:
    """A connector whose frame went through a rigid motion with its sub-structure.

    Args:
        link: with its ends already in their new places.
        motion: the motion, world frame.
    """
    pose = motion @ link.world_from_connector
    span = span_in(pose, link.start_xyz, link.end_xyz)
    return replace(link, world_from_connector=pose, span=span)


def span_in(world_from_connector: Pose, start: Vector, end: Vector) -> Vector:
    """From a connector's start to its end in the given frame, units; both are in the world's."""
    return world_from_connector.inverse().direction(subtract(end, start))


def _extent(block: Block, solid: Solid) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Smallest and largest coordinates of one solid, world frame."""
    rotation = block.world_from_block.rotation
    if isinstance(solid, Box):
        middle = block.world_from_block.apply(solid.center)
        reach = np.abs(rotation) @ (np.array(solid.size) / 2)
        return middle - reach, middle + reach
    if isinstance(solid, Ball):
        middle = block.world_from_block.apply(solid.center)
        return middle - solid.radius, middle + solid.radius
    ends = block.world_from_block.apply([solid.base, solid.top])
    axis = (ends[1] - ends[0]) / solid.length
    reach = solid.radius * np.sqrt(np.clip(1 - axis**2, 0, None))
    return ends.min(axis=0) - reach, ends.max(axis=0) + reach
