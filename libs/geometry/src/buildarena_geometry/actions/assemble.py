"""Actions that put whole machines together."""

from dataclasses import replace

from buildarena_geometry.actions.build import removal_sentences, without
from buildarena_geometry.actions.lookups import join_names, structure
from buildarena_geometry.actions.parameters import Name, RefusalError, Triple, quote
from buildarena_geometry.blocks import Block, Connector, FaceRef
from buildarena_geometry.feedback import state as words
from buildarena_geometry.feedback.words import counted, listing, point
from buildarena_geometry.outcomes import Cause
from buildarena_geometry.poses import Pose, turn_about, turned
from buildarena_geometry.rotations import ORIGIN
from buildarena_geometry.state import (
    Change,
    MachineState,
    SubStructure,
    follow,
    moved_connector,
    sub_structure_letter,
)


def add_machine(
    state: MachineState,
    *,
    machine_id: Name,
    init_shift: Triple = ORIGIN,
    init_rotation: Triple = ORIGIN,
) -> Change:
    """Add a copy of a finished machine as a sub-structure; block 3 becomes A_3, B_3 or so.

    A machine may be added several times.

    Args:
        machine_id: Its name.
        init_shift: How far it moves from where it was built [east, north, up].
        init_rotation: [yaw, pitch, roll] in degrees: yaw turns north to east, pitch north down,
            roll up to east.
    """
    source = state.available.get(machine_id)
    if source is None or not source.started:
        problem = "is empty" if source is not None else "does not exist"
        text = f"Machine {quote(machine_id)} {problem}. Machines: {join_names(state.available)}."
        raise RefusalError(Cause.NO_SUCH_MACHINE, text)
    letter = sub_structure_letter(state.structures_made)
    root = next(iter(source.blocks.values()))
    motion = turn_about(root.center_xyz, turned(init_rotation)).shifted(init_shift)
    blocks = [_copy_block(block, letter, motion) for block in source.blocks.values()]
    added = SubStructure(letter=letter, source=machine_id, root=f"{letter}_{root.id}")
    all_blocks = {**state.blocks, **{block.id: block for block in blocks}}
    links = [_copy_connector(link, letter, motion) for link in source.connectors.values()]
    connectors = {**state.connectors, **{link.id: link for link in links}}
    copied = source.occupants.items()
    occupants = {_renamed(face, letter): f"{letter}_{child}" for face, child in copied}
    after = replace(
        state,
        blocks=all_blocks,
        connectors=follow(connectors, all_blocks, {block.id for block in blocks}),
        occupants={**state.occupants, **occupants},
        structures={**state.structures, letter: added},
        structures_made=state.structures_made + 1,
    )
    return Change(
        after=after,
        placed=tuple(block.id for block in blocks),
        touched=tuple(link.id for link in links),
        attempt=f"Machine {machine_id}",
        render=lambda: _described(after, letter, f"Added {machine_id} as sub-structure {letter}"),
    )


def shift_machine(state: MachineState, machine_index: Name, position: Triple) -> Change:
    """Move a sub-structure by [east, north, up].

    Args:
        machine_index: Letter of the sub-structure, such as "A".
        position: How far to move it [east, north, up].
    """
    moving = structure(state, machine_index)
    change = f"shifted by {point(position)}"
    return _motion(state, moving, Pose(position=position), change, turned=False)


def rotate_machine(state: MachineState, machine_index: Name, rotation: Triple) -> Change:
    """Turn a sub-structure about its starting block's centre.

    Args:
        machine_index: Letter of the sub-structure, such as "A".
        rotation: [yaw, pitch, roll] in degrees: yaw turns north to east, pitch north down, roll up
            to east.
    """
    moving = structure(state, machine_index)
    center = state.blocks[moving.root].center_xyz
    motion = turn_about(center, turned(rotation))
    return _motion(state, moving, motion, f"rotated by {point(rotation)}", turned=True)


def remove_machine(state: MachineState, machine_index: Name) -> Change:
    """Remove a sub-structure with everything attached to it.

    Args:
        machine_index: Letter of the sub-structure, such as "A".
    """
    removed = structure(state, machine_index)
    gone = state.members(removed.letter)
    remaining, links = without(state, gone)
    structures = {key: other for key, other in state.structures.items() if key != removed.letter}
    after = replace(remaining, structures=structures)

    def render() -> str:
        sentences = removal_sentences(state, after, links)
        return " ".join([f"Removed sub-structure {removed.letter}.", *sentences])

    return Change(after=after, removed=(*(block.id for block in gone), *links), render=render)


def _motion(
    state: MachineState, moving: SubStructure, motion: Pose, change: str, *, turned: bool
) -> Change:
    members = state.members(moving.letter)
    moved = [replace(block, world_from_block=motion @ block.world_from_block) for block in members]
    ids = tuple(block.id for block in moved)
    after = state.with_blocks(*moved)
    connectors = {
        key: moved_connector(link, motion) if link.structure == moving.letter else link
        for key, link in after.connectors.items()
    }
    after = replace(after, connectors=connectors)
    sentence = f"Sub-structure {moving.letter} {change}"
    return Change(
        after=after,
        placed=ids,
        attempt=sentence,
        render=lambda: _moved(state, after, moving.letter, f"{sentence}.", turned=turned),
    )


def _described(state: MachineState, letter: str, sentence: str) -> str:
    """Describe a newly added sub-structure: its blocks with their free faces, its connectors."""
    members = state.members(letter)
    links = [link for link in state.connectors.values() if link.structure == letter]
    count = counted(len(members), "block")
    ids = f"{sentence}: {count} {members[0].id} to {members[-1].id}"
    lines = [f"{ids}; connectors: {listing(link.id for link in links)}."]
    lines += words.block_lines(state, members, with_faces=True)
    return "\n".join([*lines, *map(words.connector_line, links)])


def _moved(
    before: MachineState, after: MachineState, letter: str, sentence: str, *, turned: bool
) -> str:
    """Describe a sub-structure that was moved; turning it changes the sides its faces look to."""
    members = after.members(letter)
    lines = words.block_lines(after, members, with_faces=turned)
    return "\n".join([sentence, *lines, *words.losses(before, after)])


def _renamed(face: FaceRef, letter: str) -> FaceRef:
    return (f"{letter}_{face[0]}", face[1])


def _copy_block(block: Block, letter: str, motion: Pose) -> Block:
    return replace(
        block,
        id=f"{letter}_{block.id}",
        world_from_block=motion @ block.world_from_block,
        mount=block.mount and _renamed(block.mount, letter),
        lost_mount=block.lost_mount and _renamed(block.lost_mount, letter),
        structure=letter,
    )


def _copy_connector(link: Connector, letter: str, motion: Pose) -> Connector:
    return replace(
        link,
        id=f"{letter}_{link.id}",
        start=_renamed(link.start, letter),
        end=_renamed(link.end, letter),
        world_from_connector=motion @ link.world_from_connector,
        structure=letter,
    )
