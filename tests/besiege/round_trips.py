"""Machine files that are read, written by us, and read again."""

import json

import pytest

from buildarena_besiege import MachineFileError, plain_machine_file, read_machine_file
from buildarena_geometry import DocumentError, Machine


def round_trip(data: bytes) -> bool:
    """Whether a file is refused as one, or makes a machine that comes back from our own file."""
    try:
        first = read_machine_file(data)
    except MachineFileError:
        return False
    machine = first.machine
    try:
        assert Machine.from_document(json.loads(json.dumps(machine.to_document()))) == machine
    except DocumentError:
        assert any("would not be read back" in remark for remark in first.not_understood)
    second = read_machine_file(plain_machine_file(machine, name="m"))
    if not second.not_understood:
        again = second.machine
        for ours, theirs in (
            (machine.blocks, again.blocks),
            (machine.connectors, again.connectors),
        ):
            assert [kind(one) for one in theirs.values()] == [kind(one) for one in ours.values()]
        for one, other in zip(machine.blocks.values(), again.blocks.values(), strict=True):
            assert other.center_xyz == pytest.approx(one.center_xyz, rel=1e-6, abs=1e-6)
            assert (other.mount, other.flipped) == (one.mount, one.flipped)
        assert again.control_sequence == machine.control_sequence
    return True


def kind(part) -> tuple[object, ...]:
    return part.id, part.module.name, part.bindings
