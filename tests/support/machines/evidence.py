"""The machines of the first evening with a game; `make evidence-machines` writes them as data.

Who plays them has the game, and neither our expert nor these drafts.
"""

import gzip
import json
from pathlib import Path

from support.machines.drafts import KeyedDraft
from support.player import Player

import buildarena_pipeline.evidence
from buildarena_benchmark import paper_tasks
from buildarena_geometry import Machine, module_set
from buildarena_worker.builtin.designs.drafting import EAST, NORTH, SIDES, SOUTH, UP, WEST, Draft

FILE = Path(buildarena_pipeline.evidence.__file__).parent / "machines.json.gz"
ALL = module_set("all")
SPACE = 4
"""Blocks of the sampler's beam from one module to the next."""
MUTE = 12
"""Hinges that nothing moves: their 24 actions have all keys that people have."""
PROGRAM = """-- From 1 s on a wheel turns at full speed, and another at half of it.
function control(t, sense)
  if t < 1 then
    return {{}}
  end
  return {{ ["{whole}.spinning_forward"] = 1, ["{half}.spinning_forward"] = 0.5 }}
end
"""


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


def sampler() -> Machine:
    """A beam with one module of each type, its keys bound, and one of each connector."""
    draft = Draft(modules="all")
    spine = [draft.start()]
    blocks = [name for name in ALL.attachable if name != "Small Wooden Block"]
    for number, name in enumerate(blocks):
        if number % 2 == 0:
            spine += draft.row(spine[-1], NORTH, SPACE)
        made = draft.attach(spine[-2], (EAST, WEST)[number % 2], name)
        for key, action in enumerate(ALL[name].actions, 1):
            bound = {"block_id": made, "action": action, "new_key": f"Alpha{key}"}
            draft.do("change_control_key", **bound)
    for number, name in enumerate(ALL.connectors):
        first = 1 + SPACE * number
        draft.connect(spine[first], spine[first + 2], UP, connector=name)
    return draft.machine


def probe() -> Machine:
    """Three arms along the axes, on the ground: what stands still for 20 s and tells places."""
    draft = Draft()
    middle = draft.start()
    draft.row(middle, EAST, 2)
    draft.row(middle, NORTH, 3)
    draft.row(middle, UP, 1)
    return draft.machine


def dropped() -> Machine:
    """A cross that lands flat."""
    draft = Draft()
    middle = draft.start()
    for way in (EAST, WEST, NORTH, SOUTH):
        draft.attach(middle, way)
    return draft.machine


def scales() -> Machine:
    """Two beams on swivels: a log on one end, three and four wooden blocks on the other."""
    draft = Draft(modules="all")
    middle = draft.start()
    ends = [draft.row(middle, way, 4)[-1] for way in (NORTH, SOUTH)]
    for base, count in zip(ends, (3, 4), strict=True):
        for side in (EAST, WEST):
            draft.row(base, side, 3)
        post = draft.row(base, UP, 5)[-1]
        beam = draft.attach(draft.attach(post, EAST, "Swivel"), EAST)
        draft.attach(draft.row(beam, SOUTH, 2)[-1], UP, "Log")
        draft.row(draft.row(beam, NORTH, 2)[-1], UP, count)
    return draft.machine


def wheeled() -> Machine:
    """Four powered wheels that drive straight ahead for five seconds."""
    draft = KeyedDraft()
    middle = draft.start()
    front = draft.row(middle, NORTH, 2)[-1]
    back = draft.row(middle, SOUTH, 2)[-1]
    for base in (front, back):
        for side in (EAST, WEST):
            draft.bind(draft.wheel(base, side), "spinning_forward", "UpArrow")
    draft.press("UpArrow", 1.0, 5.0)
    return draft.machine


def piloted() -> Machine:
    """Two wheels in the air that a program turns, by keys after those that people have."""
    draft = Draft(modules="all")
    middle = draft.start()
    arms = [block for way in SIDES for block in draft.row(middle, way, 4)]
    post = draft.row(middle, UP, 4)[-1]
    for base in arms[:MUTE]:
        draft.attach(base, UP, "Steering Hinge")
    whole, half = (draft.wheel(post, side) for side in (EAST, WEST))
    return draft.machine.with_controller(PROGRAM.format(whole=whole, half=half))


def machines() -> dict[str, Machine]:
    """Every machine, by the name of its trial."""
    own = {"sampler": sampler(), "probe": probe(), "drop": dropped()}
    own |= {"scales": scales(), "wheels": wheeled(), "program": piloted()}
    return {**own, **{name: experts_machine(name) for name in paper_tasks()}}


def packed() -> bytes:
    """The data file."""
    documents = {name: machine.to_document() for name, machine in machines().items()}
    text = json.dumps(documents, sort_keys=True, separators=(",", ":"))
    return gzip.compress(text.encode(), mtime=0)


if __name__ == "__main__":
    FILE.write_bytes(packed())
