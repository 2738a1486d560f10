"""The action that repeats blocks on the other side of the starting block."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import dist

from buildarena_geometry.actions.build import linked
from buildarena_geometry.actions.lookups import part, require_started
from buildarena_geometry.blocks import Block, FaceRef
from buildarena_geometry.changes import Change
from buildarena_geometry.feedback import state as words
from buildarena_geometry.modules.joints import UP
from buildarena_geometry.modules.parameters import BlockIds, Plane, RefusalError
from buildarena_geometry.outcomes import Cause
from buildarena_geometry.poses import Pose
from buildarena_geometry.rotations import Vector, dot
from buildarena_geometry.state import MachineState

_SAME = 1e-6  # units; places that are nearer to each other are one


def mirror(state: MachineState, *, plane: Plane, block_ids: BlockIds = ()) -> Change:
    """Add mirror images of blocks and of connectors between them, with their keys.

    Wheels and driven hinges turn the same way under the same key.

    Args:
        plane: "x" swaps east and west, "y" north and south, about the starting block's centre.
        block_ids: Default: all blocks that are not on the plane.
    """
    require_started(state)
    chosen = [part(state, block_id) for block_id in block_ids or state.blocks]
    reflection = _Reflection(plane=plane, origin=next(iter(state.blocks.values())).center_xyz)
    after, images = state, dict[str, str]()
    for block in state.blocks.values():
        if dist(block.center_xyz, reflection.point(block.center_xyz)) < _SAME:
            images[block.id] = block.id
        elif block in chosen:
            image = str(after.next_id)
            after = _with_image(after, block, images, reflection)
            images[block.id] = image
    placed = tuple(image for block_id, image in images.items() if image != block_id)
    if not placed:
        text = "There is nothing to mirror: name blocks that are not on the plane."
        raise RefusalError(Cause.NO_SUCH_BLOCK, text)
    for link in state.connectors.values():
        if all(end in images for end in link.ends) and any(images[e] in placed for e in link.ends):
            ends = [_image_of(after, end, images, reflection) for end in (link.start, link.end)]
            connector = linked(after, link.module, ends[0], ends[1], link.note)
            connector = replace(connector, bindings=link.bindings)
            after = replace(after.with_connector(connector), next_id=after.next_id + 1)
    links = [link for id_, link in after.connectors.items() if id_ not in state.connectors]
    blocks = [after.blocks[block_id] for block_id in placed]
    return Change(
        after=after,
        placed=placed,
        touched=tuple(link.id for link in links),
        attempt="The mirror image",
        render=lambda: "\n".join(
            [
                "Mirrored.",
                *words.block_lines(after, blocks, with_faces=True),
                *map(words.connector_line, links),
            ]
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reflection:
    """A reflection over a vertical plane through a point, across x or y."""

    plane: str
    origin: Vector

    def point(self, point: Vector) -> Vector:
        (x, y, z), (east, north, _) = point, self.origin
        return (2 * east - x, y, z) if self.plane == "x" else (x, 2 * north - y, z)

    def pose(self, pose: Pose) -> Pose:
        """Return the mirrored pose of a block that is symmetric about its own plane x = 0."""
        w, x, y, z = pose.wxyz
        turn = (w, x, -y, -z) if self.plane == "x" else (z, y, x, w)
        return Pose(position=self.point(pose.xyz), quaternion=turn)


def _with_image(
    state: MachineState, block: Block, images: Mapping[str, str], reflection: _Reflection
) -> MachineState:
    module, mount = block.module, block.mount
    if module.center[0] or (module.wing is not None and module.wing.pitch_deg):
        text = f"{words.heading(block)} has no mirror image: it is not symmetric."
        raise RefusalError(Cause.OUT_OF_RANGE, text)
    if mount is None or mount[0] not in images:
        base = "no block" if mount is None else f"block {mount[0]}, which is not mirrored"
        text = f"{words.heading(block)} is attached to {base}. Mirror that block too."
        raise RefusalError(Cause.NO_SUCH_BLOCK, text)
    face = _image_of(state, mount, images, reflection)
    if state.is_occupied(state.blocks[face[0]], face[1]):
        text = f"Face {face[0]}/{face[1]} is taken, so {words.title(block)} cannot be mirrored."
        raise RefusalError(Cause.FACE_OCCUPIED, text)
    pose, axis = reflection.pose(block.world_from_block), module.joint.axis if module.joint else UP
    turned_round = dot(block.world_from_block.direction(axis), pose.direction(axis)) < 0.0
    image = replace(
        block,
        id=str(state.next_id),
        world_from_block=pose,
        mount=face,
        flipped=block.flipped != (module.spins and turned_round),
        structure=state.blocks[face[0]].structure,
    )
    return replace(
        state,
        blocks={**state.blocks, image.id: image},
        occupants={**state.occupants, face: image.id},
        next_id=state.next_id + 1,
    )


def _image_of(
    state: MachineState, face: FaceRef, images: Mapping[str, str], reflection: _Reflection
) -> FaceRef:
    """Return the face at the mirror image of a face, on the image of its block."""
    target = reflection.point(state.blocks[face[0]].face_center(face[1]))
    image = state.blocks[images[face[0]]]
    for label in image.module.face_of_label:
        if dist(image.face_center(label), target) < _SAME:
            return image.id, label
    text = f"{words.heading(image)} is not symmetric about the plane."
    raise RefusalError(Cause.OUT_OF_RANGE, text)
