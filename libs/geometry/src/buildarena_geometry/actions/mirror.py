"""The action that repeats blocks on the other side of the starting block."""

from dataclasses import replace
from math import dist

from buildarena_geometry.actions.build import linked
from buildarena_geometry.actions.lookups import part
from buildarena_geometry.blocks import Block, Connector, FaceRef
from buildarena_geometry.changes import Change
from buildarena_geometry.feedback import state as words
from buildarena_geometry.modules.joints import UP
from buildarena_geometry.modules.parameters import BlockIds, Plane, RefusalError
from buildarena_geometry.outcomes import Cause
from buildarena_geometry.poses import Pose
from buildarena_geometry.rotations import Quaternion, Vector, dot
from buildarena_geometry.state import MachineState

_SAME = 1e-6  # units; places that are nearer to each other are one


def mirror(state: MachineState, *, plane: Plane, block_ids: BlockIds = ()) -> Change:
    """Add mirror images of blocks and of connectors between them, with their keys.

    Wheels and driven hinges turn the same way under the same key.

    Args:
        plane: "x" swaps east and west, "y" north and south, about the starting block's centre.
        block_ids: Default: all blocks that are not on the plane.
    """
    chosen = [part(state, block_id) for block_id in block_ids or state.blocks]
    origin = _starting_block(state).center_xyz
    after, images, placed = state, dict[str, str](), list[str]()
    for block in state.blocks.values():
        if dist(block.center_xyz, _reflected(block.center_xyz, origin, plane)) < _SAME:
            images[block.id] = block.id
        elif block in chosen:
            images[block.id] = str(after.next_id)
            placed.append(images[block.id])
            after = _with_image(after, block, images, origin, plane)
    links = [link for link in state.connectors.values() if not images.keys().isdisjoint(link.ends)]
    for link in links:
        if all(end in images for end in link.ends) and any(images[e] != e for e in link.ends):
            after = _with_link(after, link, images, origin, plane)
    if not placed:
        text = "There is nothing to mirror: name blocks that are not on the plane."
        raise RefusalError(Cause.NO_SUCH_BLOCK, text)
    made = [id_ for id_ in after.connectors if id_ not in state.connectors]
    return Change(
        after=after,
        placed=tuple(placed),
        touched=tuple(made),
        attempt="The mirror image",
        render=lambda: "\n".join(
            [
                "Mirrored.",
                *words.block_lines_with_faces(after, [after.blocks[id_] for id_ in placed]),
                *(words.connector_line(after.connectors[id_]) for id_ in made),
            ]
        ),
    )


def _starting_block(state: MachineState) -> Block:
    first = next(iter(state.blocks), "1")
    found = part(state, first)
    assert isinstance(found, Block)  # noqa: S101  the first part is one
    return found


def _with_image(
    state: MachineState, block: Block, images: dict[str, str], origin: Vector, plane: str
) -> MachineState:
    module, mount = block.module, block.mount
    if module.center[0] or (module.wing is not None and module.wing.pitch_deg):
        text = f"{words.heading(block)} has no mirror image: it is not symmetric."
        raise RefusalError(Cause.OUT_OF_RANGE, text)
    if mount is None or mount[0] not in images:
        base = "no block" if mount is None else f"block {mount[0]}, which is not mirrored"
        text = f"{words.heading(block)} is attached to {base}. Mirror that block too."
        raise RefusalError(Cause.NO_SUCH_BLOCK, text)
    face = _image_of_face(state, mount, images, origin, plane)
    if state.is_occupied(state.blocks[face[0]], face[1]):
        text = f"Face {face[0]}/{face[1]} is taken, so {words.title(block)} cannot be mirrored."
        raise RefusalError(Cause.FACE_OCCUPIED, text)
    pose = _reflected_pose(block.world_from_block, origin, plane)
    axis = UP if module.joint is None else module.joint.axis
    reversed_axis = dot(block.world_from_block.direction(axis), pose.direction(axis)) < 0.0
    image = replace(
        block,
        id=str(state.next_id),
        world_from_block=pose,
        mount=face,
        flipped=block.flipped != (module.spins and reversed_axis),
        structure=state.blocks[face[0]].structure,
    )
    return replace(
        state,
        blocks={**state.blocks, image.id: image},
        occupants={**state.occupants, face: image.id},
        next_id=state.next_id + 1,
    )


def _with_link(
    state: MachineState, link: Connector, images: dict[str, str], origin: Vector, plane: str
) -> MachineState:
    ends = [_image_of_face(state, end, images, origin, plane) for end in (link.start, link.end)]
    image = replace(linked(state, link.module, ends[0], ends[1], link.note), bindings=link.bindings)
    return replace(state.with_connector(image), next_id=state.next_id + 1)


def _image_of_face(
    state: MachineState, face: FaceRef, images: dict[str, str], origin: Vector, plane: str
) -> FaceRef:
    """The face where the mirror image of a face is, on the image of its block."""
    wanted = _reflected(state.blocks[face[0]].face_center(face[1]), origin, plane)
    image = state.blocks[images[face[0]]]
    for label in image.module.face_of_label:
        if dist(image.face_center(label), wanted) < _SAME:
            return image.id, label
    text = f"{words.heading(image)} is not symmetric about the plane."
    raise RefusalError(Cause.OUT_OF_RANGE, text)


def _reflected(point: Vector, origin: Vector, plane: str) -> Vector:
    x, y, z = point
    return (2 * origin[0] - x, y, z) if plane == "x" else (x, 2 * origin[1] - y, z)


def _reflected_pose(pose: Pose, origin: Vector, plane: str) -> Pose:
    """The mirrored pose of a block that is symmetric about the plane x = 0 of its own frame."""
    w, x, y, z = pose.wxyz
    turn: Quaternion = (w, x, -y, -z) if plane == "x" else (z, y, x, w)
    return Pose(position=_reflected(pose.xyz, origin, plane), quaternion=turn)
