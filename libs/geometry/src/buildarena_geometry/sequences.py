"""Runs action sequences in the golden vectors' format and tells states in their words."""

from __future__ import annotations

import gzip
import json
import zlib
from typing import TYPE_CHECKING, Any

from .besiege import besiege_point, besiege_rotation, besiege_span
from .errors import SequenceError
from .machine import Machine
from .outcomes import Cause, Refused
from .reading import Reader
from .rotations import scaled

if TYPE_CHECKING:
    from collections.abc import Iterator

    from .blocks import Block, Connector, FaceRef
    from .modules import Catalogue
    from .outcomes import Outcome
    from .state import MachineState

_GZIP_MAGIC = b"\x1f\x8b"

# The vectors know no name of their own for these.
_KIND_OF_CAUSE = {
    Cause.EXCESS_CONNECTION: "too_close",
    Cause.UNKNOWN_ACTION: "bad_action",
}


def run_sequences(
    content: object, *, every_state: bool = True, catalogue: Catalogue | None = None
) -> Iterator[dict[str, Any]]:
    """Builds the machines of some sequences.

    Args:
        content: JSON values: a list of sequences, one sequence, or a bare list of {op, params}.
        every_state: whether each step tells the state after it, or the last step only.
        catalogue: the modules to build with; the basic ones if left out.

    Yields:
        {"seed", "steps": [{"ok", "kind", "state"}]} for each sequence.

    Raises:
        SequenceError: the content has another form.
    """
    root = Reader(value=content, where="input", error=SequenceError)
    for sequence in _sequences(root):
        entries = sequence.value
        machine, steps = _prepare(sequence, catalogue)
        told: list[dict[str, Any]] = []
        for step in steps:
            outcome = _act(machine, step)
            told.append({"ok": outcome.ok, "kind": kind_of(outcome)})
            if every_state:
                told[-1]["state"] = state_entry(machine.state)
        if told and not every_state:
            told[-1]["state"] = state_entry(machine.state)
        seed = entries.get("seed") if isinstance(entries, dict) else None
        yield {"seed": seed, "steps": told}


def parse(data: bytes) -> object:
    """The JSON values of a sequence file, plain or compressed by gzip.

    Raises:
        SequenceError: it is not JSON, or damaged.
    """
    try:
        plain = gzip.decompress(data) if data.startswith(_GZIP_MAGIC) else data
        content: object = json.loads(plain)
    except (OSError, EOFError, zlib.error) as error:
        raise SequenceError(f"input: not gzip: {error}") from error
    except (ValueError, RecursionError) as error:
        raise SequenceError(f"input: not JSON: {error}") from error
    return content


def kind_of(outcome: Outcome) -> str:
    """What the vectors call an outcome."""
    if isinstance(outcome, Refused):
        return _KIND_OF_CAUSE.get(outcome.cause, outcome.cause.value)
    return "ok"


def state_entry(state: MachineState) -> dict[str, Any]:
    """A state in the vectors' field names; positions are east, north, up."""
    return {
        "blocks": [
            *(_block_entry(state, block) for block in state.blocks.values()),
            *(_connector_entry(link) for link in state.connectors.values()),
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


def _sequences(root: Reader) -> Iterator[Reader]:
    if isinstance(root.value, dict):
        yield root
        return
    entries = list(root.items())
    if (
        all(isinstance(entry.value, dict) and "steps" in entry.value for entry in entries)
        and entries
    ):
        yield from entries
    else:
        yield root


def _prepare(sequence: Reader, catalogue: Catalogue | None) -> tuple[Machine, list[Reader]]:
    if not isinstance(sequence.value, dict):
        return Machine(catalogue=catalogue), list(sequence.items())
    if "steps" not in sequence.value:
        raise SequenceError(f"{sequence.where}: steps are missing")
    available: dict[str, Machine] = {}
    subs = Reader(
        value=sequence.value.get("sub_machines") or {},
        where=f"{sequence.where}.sub_machines",
        error=SequenceError,
    )
    for name, steps in subs.entries():
        available[name] = Machine(catalogue=catalogue)
        for step in steps.items():
            _act(available[name], step)
    steps = Reader(
        value=sequence.value["steps"], where=f"{sequence.where}.steps", error=SequenceError
    )
    return Machine(catalogue=catalogue, available=available), list(steps.items())


def _act(machine: Machine, step: Reader) -> Outcome:
    if not isinstance(step.value, dict) or "op" not in step.value:
        step.fail("an object with op and params")
    return machine.act(step.value["op"], step.value.get("params"))


def _block_entry(state: MachineState, block: Block) -> dict[str, Any]:
    center = list(block.center_xyz)
    entry: dict[str, Any] = {
        "id": block.id,
        "name": block.module.name,
        "pos": list(block.world_from_block.xyz),
        "virtual": list(besiege_point(block.world_from_block.xyz)),
        "center": center,
        "center_follow": center,
        "quat": list(besiege_rotation(block)),
        "flipped": block.flipped,
    }
    if block.module.faces:
        entry["faces"] = {
            face.label: {
                "c": list(block.face_center(face.label)),
                "n": list(block.face_normal(face.label)),
                "att": not state.is_occupied(block, face.label),
            }
            for face in block.module.faces
        }
    if block.mount is not None:
        entry["root_face"] = _seat(block, block.mount)
    elif block.lost_mount is not None:
        entry["root_face"] = [None, block.lost_mount[1], block.lost_mount[0]]
    if block.pointing_xyz is not None:
        entry["pointing"] = list(block.pointing_xyz)
    if block.module.spins:
        # Seen in Besiege's left-handed components the spin's sense is the other way round.
        entry["spin"] = list(scaled(block.axis_xyz, -1.0 if block.flipped else 1.0))
    if block.module.actions:
        entry["keys"] = {action: list(keys) for action, keys in block.bindings.items()}
    return entry


def _connector_entry(link: Connector) -> dict[str, Any]:
    root = list(link.world_from_connector.xyz)
    return {
        "id": link.id,
        "name": link.module.name,
        "pos": root,
        "virtual": list(besiege_point(link.world_from_connector.xyz)),
        "center": root,
        "center_follow": root,
        "quat": list(besiege_rotation(link)),
        "flipped": False,
        "connector": {
            "start": _seat(link, link.start),
            "end": _seat(link, link.end),
            "start_point": list(link.start_xyz),
            "end_point": list(link.end_xyz),
            "projection_virtual": list(besiege_span(link)),
        },
    }


def _seat(part: Block | Connector, face: FaceRef) -> list[str | None]:
    """A face by its block and label.

    The vectors look faces up by the ids of the machine a sub-structure was copied from, which are
    unknown in the assembly: there the block's place is empty, and the id comes last.
    """
    block, label = face
    prefix = f"{part.structure}_"
    if part.structure and part.id.startswith(prefix):
        return [None, label, block.removeprefix(prefix)]
    return [block, label]
