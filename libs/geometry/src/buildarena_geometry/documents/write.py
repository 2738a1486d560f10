"""Machines as JSON documents.

The parts decide what the machine is, and are checked like a machine's; the log is its history.
Quaternions and positions are written in full, so a machine that is read back equals the one that
was written, bit for bit. `controller` is there only where it has one.
"""

from typing import Any

import msgspec

from buildarena_geometry.blocks import Block, Connector
from buildarena_geometry.documents.log import LoggedState

DOCUMENT_VERSION = 1


def machine_document(machine: LoggedState) -> dict[str, Any]:
    """Return the document of a machine with its log, JSON values throughout.

    Positions are in units, world frame; quaternions are (w, x, y, z).
    """
    state = machine.state
    return {
        "version": DOCUMENT_VERSION,
        "blocks": [_block_entry(block) for block in state.blocks.values()],
        "joints": [
            {"base": joint.base, "face": joint.face, "part": joint.part, "holds": joint.holds}
            for joint in state.joints()
        ],
        "connectors": [_connector_entry(link) for link in state.connectors.values()],
        "control_sequence": [msgspec.to_builtins(press) for press in state.control_sequence],
        "structures": [msgspec.to_builtins(part) for part in state.structures.values()],
        "structures_made": state.structures_made,
        "next_id": state.next_id,
        "available": {
            name: machine_document(available) for name, available in machine.available.items()
        },
        "log": [
            {"name": record.name, "arguments": record.arguments, "reason": record.reason}
            for record in machine.records
        ],
        **({"controller": state.controller} if state.controller else {}),
    }


def _block_entry(block: Block) -> dict[str, Any]:
    return {
        "id": block.id,
        "module": block.module.name,
        "position": list(block.world_from_block.xyz),
        "quaternion": list(block.world_from_block.wxyz),
        "mount": None if block.mount is None else list(block.mount),
        "lost_mount": None if block.lost_mount is None else list(block.lost_mount),
        "flipped": block.flipped,
        "bindings": {action: list(keys) for action, keys in block.bindings.items()},
        "structure": block.structure,
        "note": block.note,
    }


def _connector_entry(link: Connector) -> dict[str, Any]:
    # Braces and winches take no keys, and their documents keep their bytes.
    keys = {action: list(keys) for action, keys in link.bindings.items()}
    return {
        "id": link.id,
        "module": link.module.name,
        "start": list(link.start),
        "end": list(link.end),
        "position": list(link.world_from_connector.xyz),
        "quaternion": list(link.world_from_connector.wxyz),
        "span": list(link.span),
        **({"bindings": keys} if keys else {}),
        "structure": link.structure,
        "note": link.note,
    }
