"""Everything a machine is at one moment, as a value.

Actions never change a state: they make the next one. So a refused action leaves no trace by
construction, and feedback can be put into words long after the machine has moved on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from buildarena_geometry.blocks import Block, Connector, FaceRef, Joint, KeyPress
from buildarena_geometry.modules.module import Catalogue
from buildarena_geometry.modules.solids import Ball, Box, Solid
from buildarena_geometry.poses import Pose
from buildarena_geometry.rotations import Vector, add, dot, rotation_rows, scaled, subtract
from buildarena_geometry.struct_reader import Form


class SubStructure(Form, frozen=True, kw_only=True):
    """A machine inside an assembly.

    Attributes:
        letter: the prefix of its blocks' ids.
        source: the key of the machine it is a copy of.
        root: id of its starting block.
    """

    letter: str
    source: str
    root: str


def sub_structure_letter(count: int) -> str:
    """Return the letter of a sub-structure with `count` added before it: A to Z, then AA, AB."""
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
        available: the machines an assembly is made of, by name, as states; none in a machine that
            is built from a starting block.
        blocks: by id, in the order of creation.
        connectors: by id, in the order of creation.
        occupants: the id of the block that sits on a face, by that face.
        structures: an assembly's sub-structures by letter.
        structures_made: number of letters already assigned.
        control_sequence: in the order of entry.
        controller: program that replaces the control sequence; "" if there is none.
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
        """True if there is a starting block."""
        return bool(self.blocks)

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
        points = [block.center_xyz for block in self.blocks.values()]
        links = self.connectors.values()
        return np.array(points + [scaled(add(link.start_xyz, link.end_xyz), 0.5) for link in links])

    @property
    def inertia(self) -> NDArray[np.float64]:
        """(3,) moments of inertia about axes through the center of mass along the world's.

        Blocks count as solid boxes of their outer dimensions, connectors as points.
        """
        masses = np.array([part.mass for part in self.parts])
        squares = (self._centers - self.center_of_mass) ** 2
        low, high = self._extents
        squares[: len(self.blocks)] += np.maximum(high - low, 0.0) ** 2 / 12
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
        low, high = self._extents
        return np.array([low.min(axis=0), high.max(axis=0)])

    @property
    def _extents(self) -> NDArray[np.float64]:
        """(2, N, 3) smallest and largest coordinates of each block's body, world frame."""
        return np.array([_extent(block) for block in self.blocks.values()]).swapaxes(0, 1)

    def is_occupied(self, block: Block, label: str) -> bool:
        """Check if a face of the block is in use by an attachment, its own or another block's."""
        if (block.id, label) in self.occupants:
            return True
        return block.mount is not None and label == block.module.root_face

    def free_faces(self, block: Block) -> list[str]:
        """Return the labels of a block's faces that take another block."""
        labels = block.module.face_of_label
        return [label for label in labels if not self.is_occupied(block, label)]

    def children(self, block: Block) -> list[Block]:
        """Return the blocks that sit on a block."""
        children = (self.occupants.get((block.id, face.label)) for face in block.module.faces)
        return [self.blocks[child] for child in children if child is not None]

    def joint(self, part: Block) -> Joint | None:
        """Return the attachment of a block to the face it sits on; None if it sits on none."""
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
        """Yield the attachments of the blocks, in the order of the blocks."""
        for block in self.blocks.values():
            joint = self.joint(block)
            if joint is not None:
                yield joint

    def detached(self) -> tuple[str, ...]:
        """Return the ids of the blocks that no intact joint and no connector links to the first."""
        held = [(joint.base, joint.part) for joint in self.joints() if joint.holds]
        tied = [link.ends for link in self.connectors.values()]
        leaders = joined(self.blocks, [*held, *tied])
        first = next(iter(leaders.values()), "")
        return tuple(block for block, leader in leaders.items() if leader != first)

    def members(self, letter: str) -> list[Block]:
        """Return the blocks of a sub-structure, including those attached to it later."""
        return [block for block in self.blocks.values() if block.structure == letter]

    def keys_in_use(self) -> tuple[str, ...]:
        """Return the keys that are bound to some action, in the order of the blocks."""
        bound = (key for part in self.powered() for keys in part.bindings.values() for key in keys)
        return tuple(dict.fromkeys(bound))

    def powered(self) -> tuple[Block | Connector, ...]:
        """Return the blocks, then the connectors, that take keys."""
        return tuple(part for part in self.parts if part.module.actions)

    def with_connector(self, link: Connector) -> MachineState:
        """Return the state in which this connector is new or replaced."""
        return replace(self, connectors={**self.connectors, link.id: link})

    def with_blocks(self, *changed: Block) -> MachineState:
        """Return the state with these blocks new or replaced; connectors on them follow."""
        blocks = {**self.blocks, **{block.id: block for block in changed}}
        connectors = follow(self.connectors, blocks, {block.id for block in changed})
        return replace(self, blocks=blocks, connectors=connectors)


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A valid action's effect; overlaps are checked before it is applied.

    Attributes:
        render: function that words the feedback.
        placed: ids of new or moved blocks; they form one rigid body and are not tested against each
            other.
        removed: ids of removed blocks and connectors.
        touched: ids of other parts that changed without moving.
        attempt: beginning of the refusal text in case of an overlap.
    """

    after: MachineState
    render: Callable[[], str]
    placed: tuple[str, ...] = ()
    removed: tuple[str, ...] = ()
    touched: tuple[str, ...] = ()
    attempt: str = ""


def joined(blocks: Iterable[str], pairs: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Return, for each block, the id of one of those that pairs join it to, its group's leader."""
    leader = {block: block for block in blocks}

    def find(block: str) -> str:
        while leader[block] != block:
            leader[block] = leader[leader[block]]
            block = leader[block]
        return block

    for first, second in pairs:
        leader[find(second)] = find(first)
    return {block: find(block) for block in leader}


def follow(
    connectors: Mapping[str, Connector], blocks: Mapping[str, Block], moved: AbstractSet[str]
) -> Mapping[str, Connector]:
    """Move the ends of connectors to the current positions of the faces they sit on.

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
    """Return a connector whose frame went through a rigid motion with its sub-structure.

    Args:
        link: connector with its ends already moved.
        motion: rigid motion, world frame.
    """
    pose = motion @ link.world_from_connector
    span = span_in(pose, link.start_xyz, link.end_xyz)
    return replace(link, world_from_connector=pose, span=span)


def span_in(world_from_connector: Pose, start: Vector, end: Vector) -> Vector:
    """Return the vector from a connector's start to its end in the given frame, units."""
    return world_from_connector.inverse().direction(subtract(end, start))


def _extent(block: Block) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the smallest and largest coordinates of a block's body; without one, inf and -inf."""
    pose = block.world_from_block
    rows = rotation_rows(pose.wxyz)
    low, high = [(math.inf,) * 3], [(-math.inf,) * 3]
    for solid in block.module.body:
        middle, reach = pose.point(solid.center), _reach(solid, rows)
        low.append(subtract(middle, reach))
        high.append(add(middle, reach))
    return tuple(map(min, *low)), tuple(map(max, *high))


def _reach(solid: Solid, rows: tuple[Vector, Vector, Vector]) -> Vector:
    """Return how far a turned solid extends from its middle along the world's axes.

    Args:
        rows: rotation matrix of its block.
    """
    if isinstance(solid, Ball):
        return (solid.radius,) * 3
    if isinstance(solid, Box):
        x, y, z = scaled(solid.size, 0.5)
        a, b, c = [abs(i) * x + abs(j) * y + abs(k) * z for i, j, k in rows]
        return a, b, c
    shaft, radius = scaled(subtract(solid.top, solid.base), 1 / solid.length), solid.radius
    along = [dot(shaft, row) for row in rows]
    a, b, c = [abs(d) * solid.length / 2 + radius * math.sqrt(max(0.0, 1 - d * d)) for d in along]
    return a, b, c
