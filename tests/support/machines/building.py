"""Machines of a few parts, built step by step."""

from typing import Any

from support.player import Player

from buildarena_benchmark.experts.drafting import Direction, Draft
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


class KeyedDraft(Draft):
    """A machine under construction whose keys are bound while it is drafted."""

    def placed(self, base: str, face: Direction, module: str, y_axis: Direction) -> str:
        """A block on a face, twisted until its own y axis looks a way."""
        made = self.attach(base, face, module)
        self.turn_axis(made, 1, y_axis)
        return made

    def act(self, name: str, arguments: dict[str, Any]) -> None:
        self.do(name, **arguments)

    def bind(self, block: str, action: str, key: str) -> None:
        self.do("add_control_key", block_id=block, action=action, new_key=key)

    def press(self, key: str, time: float, hold_for: float) -> None:
        self.do("add_control_sequence", time=time, key=key, hold_for=hold_for)


def experts_machine(task: str) -> Machine:
    """What the expert builds, with its key presses."""
    asked = Player()("builtin/expert", task=task).suspended
    assert asked is not None
    document = asked.machine.to_document()
    if asked.controls is not None:
        document["control_sequence"] = [
            {"time_s": press.time_s, "key": press.key, "hold_for_s": press.hold_for_s}
            for press in asked.controls
        ]
    return Machine.from_document(document)
