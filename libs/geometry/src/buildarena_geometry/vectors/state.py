"""Verdicts and states in the golden vectors' words."""

from collections.abc import Iterable, Mapping
from typing import Any

from buildarena_geometry.besiege_components import besiege_offset, besiege_point, besiege_rotation
from buildarena_geometry.blocks import Block, Connector, FaceRef
from buildarena_geometry.dialects import Dialect
from buildarena_geometry.outcomes import Cause, Outcome, Refused
from buildarena_geometry.rotations import Vector, scaled
from buildarena_geometry.state import MachineState

# The vectors have no separate name for these.
_KIND_OF_CAUSE = {Cause.EXCESS_CONNECTION: "too_close", Cause.UNKNOWN_ACTION: "bad_action"}


def kind_of(outcome: Outcome, kinds: Mapping[str, str]) -> str:
    """Return the vectors' name for an outcome.

    Args:
        kinds: names that a dialect uses instead, by kind.
    """
    if not isinstance(outcome, Refused):
        return "ok"
    kind = _KIND_OF_CAUSE.get(outcome.cause, outcome.cause.value)
    return kinds.get(kind, kind)


def state_entry(state: MachineState, order: Iterable[str], dialect: Dialect) -> dict[str, Any]:
    """Convert a state to the vectors' field names; positions are east, north, up.

    Args:
        order: the ids of all its parts in the order to write them in.
        dialect: dialect of the output.
    """
    return {
        "blocks": [
            _block_entry(state, state.blocks[part], dialect)
            if part in state.blocks
            else _connector_entry(state.connectors[part], dialect.connector_center)
            for part in order
        ],
        "n": len(state.blocks) + len(state.connectors),
        "cost": state.cost,
        "mass": state.mass,
        "next_id": state.next_id,
        "control_sequence": [
            {"time": press.time_s, "key": press.key, "hold_for": press.hold_for_s}
            for press in state.control_sequence
        ],
    }


def _block_entry(state: MachineState, block: Block, dialect: Dialect) -> dict[str, Any]:
    entry = _part_entry(block, block.world_from_block.xyz, block.center_xyz, flipped=block.flipped)
    free = state.free_faces(block)
    if block.module.faces:
        entry["faces"] = {
            label: {
                "c": list(block.face_center(label)),
                "n": list(block.face_normal(label)),
                "att": label in free,
            }
            for label in block.module.face_of_label
        }
    if block.mount is not None:
        entry["root_face"] = _seat(block, block.mount)
    elif block.lost_mount is not None:
        base, label = block.lost_mount
        entry["root_face"] = [base, label] if dialect.keeps_lost_mounts else [None, label, base]
    if block.pointing_xyz is not None:
        entry["pointing"] = list(block.pointing_xyz)
    if block.module.spins:
        # Besiege's components are left-handed, which reverses the spin's sense.
        entry["spin"] = list(scaled(block.axis_xyz, 1.0 if block.forward_is_clockwise else -1.0))
    if block.module.actions:
        entry["keys"] = {action: list(keys) for action, keys in block.bindings.items()}
    return entry


def _part_entry(
    part: Block | Connector, root: Vector, shown: Vector, *, flipped: bool
) -> dict[str, Any]:
    return {
        "id": part.id,
        "name": part.module.name,
        "pos": list(root),
        "virtual": list(besiege_point(root)),
        "center": list(shown),
        "center_follow": list(shown),
        "quat": list(besiege_rotation(part)),
        "flipped": flipped,
    }


def _connector_entry(link: Connector, shift: float) -> dict[str, Any]:
    root = link.world_from_connector.xyz
    shown = link.world_from_connector.point((0.0, 0.0, shift)) if shift else root
    return {
        **_part_entry(link, root, shown, flipped=False),
        "connector": {
            "start": _seat(link, link.start),
            "end": _seat(link, link.end),
            "start_point": list(link.start_xyz),
            "end_point": list(link.end_xyz),
            "projection_virtual": list(besiege_offset(link.span)),
        },
    }


def _seat(part: Block | Connector, face: FaceRef) -> list[str | None]:
    """Return a face as its block and label.

    The vectors look faces up by the ids of the machine a sub-structure was copied from, which are
    unknown in the assembly: there the block's place is empty, and the id comes last.
    """
    block, label = face
    prefix = f"{part.structure}_"
    if part.structure and part.id.startswith(prefix):
        return [None, label, block.removeprefix(prefix)]
    return [block, label]
