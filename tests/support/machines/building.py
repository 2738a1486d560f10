"""Machines of a few parts, built step by step."""

from typing import Any

from buildarena_geometry import Machine, Outcome

BLOCK = "Small Wooden Block"


def attach(machine: Machine, base: str, face: str, module: str = BLOCK, **more: Any) -> Outcome:
    place = {"base_block": base, "face": face, "new_block": module, **more}
    return machine.act("attach_block_to", place)


def connect(machine: Machine, *ends: str, connector: str = "Brace") -> Outcome:
    """A connector from (block, face) to (block, face)."""
    names = ("block_a", "face_a", "block_b", "face_b")
    given = {**dict(zip(names, ends, strict=True)), "connector": connector}
    return machine.act("connect_blocks", given)


def built(*parts: tuple[str, str, str], catalogue: Any = None, **start: Any) -> Machine:
    """A machine of (base, face, module) triples, each of which must be accepted."""
    machine = Machine(catalogue=catalogue)
    assert machine.act("start", start).ok
    for part in parts:
        done = attach(machine, *part)
        assert done.ok, done.text
    return machine
