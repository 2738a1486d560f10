"""Mutations and crossovers of genomes; every draw comes from a generator that is given."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scenarios.hunt.variation.genome import Actions, Genome, act, changed, grown, replayed

from buildarena_geometry import Block, Machine

Draw = np.random.Generator
Mutation = Callable[[Machine, str, Draw], Actions]

WOOD, WHEEL, CANNON, TORCH = "Small Wooden Block", "Powered Wheel", "Water Cannon", "Torch"
START: Final = MappingProxyType({"op": "start", "params": {}, "makes": "1"})
"""What every machine begins with."""
_COMMON: Final = (0.4, 0.3, 0.1, 0.1, 0.05, 0.05)
_MODULES: Final[Mapping[str, tuple[tuple[str, ...], tuple[float, ...]]]] = MappingProxyType(
    {
        "support": ((WOOD, WHEEL), (0.95, 0.05)),
        "transport": ((WOOD, WHEEL, CANNON), (0.6, 0.35, 0.05)),
        "lift": ((WOOD, CANNON, TORCH), (0.4, 0.3, 0.3)),
        "mechanisms": (
            (
                *(WOOD, "Log", "Large Wheel", "Suspension", "Steering Hinge", "Steering Block"),
                *("Swivel", "Grabber", "Cog Medium Powered", "Cog Large Unpowered"),
            ),
            (0.3, 0.1, 0.1, 0.1, 0.08, 0.08, 0.06, 0.06, 0.06, 0.06),
        ),
        "flight": (
            (WOOD, "Log", "Wing Panel", "Sqr Balloon", "Balloon", "Flying Block", "Drag Block"),
            (0.3, 0.1, 0.2, 0.15, 0.1, 0.1, 0.05),
        ),
        "control": (
            (WOOD, WHEEL, "Flying Block", "Log", "Ballast", "Steering Hinge", "Large Wheel"),
            (0.3, 0.2, 0.2, 0.1, 0.08, 0.06, 0.06),
        ),
        "throwing": (
            (WOOD, "Log", "Ballast", "Swivel", "Hinge", "Steering Hinge", "Boulder", "Bomb Holder"),
            (0.4, 0.1, 0.1, 0.1, 0.1, 0.1, 0.05, 0.05),
        ),
        "driving": ((WOOD, WHEEL, "Large Wheel", "Log", "Steering Hinge", "Ballast"), _COMMON),
        "delivering": ((WOOD, WHEEL, "Grabber", "Log", "Piston", "Swivel"), _COMMON),
    }
)
_PROGRAM_SHARE: Final = 0.5
"""How many changes of a machine with a program are of the program."""
_KEYS: Final = ("UpArrow", "DownArrow", "LeftArrow")
_ANGLES: Final = (90, 180, 270, 45, 30)
_SHIFTS: Final = (-0.5, -0.25, 0.0, 0.0, 0.25, 0.5)


def mutated(genome: Genome, category: str, draw: Draw) -> Genome:
    """A genome with one to four random changes; some of them may come to nothing."""
    for _ in range(int(draw.integers(1, 5))):
        if category == "control" and draw.random() < _PROGRAM_SHARE:
            program = changed(genome.program, grown(genome)[0], draw)
            genome = replace(genome, program=program)
            continue
        names = sorted(genome.sub_structures)
        which = str(draw.choice(names)) if names and draw.random() < 0.7 else None
        if which is None:
            available = {name: replayed(genome.sub_structures[name])[0] for name in names}
            log = _changed(genome.actions, available, category, draw)
            genome = replace(genome, actions=log)
        else:
            log = _changed(genome.sub_structures[which], {}, category, draw)
            logs = {**genome.sub_structures, which: log}
            genome = replace(genome, sub_structures=logs)
    return grown(genome)[1]


def crossed(first: Genome, second: Genome, draw: Draw) -> Genome:
    """The beginning of one genome and the end of another."""
    logs = {
        name: _spliced(log, second.sub_structures.get(name, log), draw)
        for name, log in first.sub_structures.items()
    }
    actions = _spliced(first.actions, second.actions, draw)
    program = (first, second)[int(draw.integers(2))].program if second.program else first.program
    return grown(Genome(actions=actions, sub_structures=logs, program=program))[1]


def _spliced(first: Actions, second: Actions, draw: Draw) -> Actions:
    head = int(draw.integers(1, len(first) + 1)) if first else 0
    tail = int(draw.integers(0, len(second) + 1))
    return [*first[:head], *second[tail:]]


def _changed(log: Actions, available: Mapping[str, Machine], category: str, draw: Draw) -> Actions:
    if draw.random() < 0.35:
        return _edited(log, category, draw)
    machine, kept = replayed(log, available)
    if not machine.blocks:
        return kept
    mutations, weights = zip(*_GROWTHS[category], strict=True)
    chosen = mutations[int(draw.choice(len(mutations), p=np.array(weights) / sum(weights)))]
    return [*kept, *chosen(machine, category, draw)]


def _edited(log: Actions, category: str, draw: Draw) -> Actions:
    """Takes an action out, cuts the end off, or gives an action another value."""
    if len(log) < 2:
        return log
    at = int(draw.integers(1, len(log)))
    kind = draw.random()
    if kind < 0.4:
        return [*log[:at], *log[at + 1 :]]
    if kind < 0.5:
        return log[:at]
    if kind < 0.6:
        return [_turned_start(log[0], draw), *log[1:]]
    return [*log[:at], _revalued(log[at], category, draw), *log[at + 1 :]]


def _turned_start(action: dict[str, Any], draw: Draw) -> dict[str, Any]:
    if action["op"] != "start":
        return action
    yaw, pitch = int(draw.choice((0, 15, 45, 90))), int(draw.choice((0, 0, 0, 10, 45, 90)))
    return {**action, "params": {**action["params"], "init_rotation": [yaw, pitch, 0]}}


def _revalued(action: dict[str, Any], category: str, draw: Draw) -> dict[str, Any]:
    params = dict(action["params"])
    if "new_block" in params:
        params["new_block"] = _module(category, draw)
    elif "connector" in params:
        params["connector"] = "Winch" if params["connector"] == "Brace" else "Brace"
    elif "hold_for" in params:
        params["time"] = round(float(draw.uniform(0.2, 5.0)), 2)
        params["hold_for"] = round(float(draw.choice((0.1, 0.3, 1.0, 3.0, 8.0))), 2)
    elif "angle" in params:
        params["angle"] = int(draw.choice(_ANGLES))
    elif "init_shift" in params:
        params["init_shift"] = [
            round(float(value + draw.choice(_SHIFTS)), 2) for value in params["init_shift"]
        ]
    return {**action, "params": params}


def _module(category: str, draw: Draw) -> str:
    names, shares = _MODULES[category]
    return str(draw.choice(names, p=shares))


def _any_block(machine: Machine, draw: Draw) -> Block:
    blocks = list(machine.blocks.values())
    return blocks[int(draw.integers(len(blocks)))]


def _any_face(block: Block, draw: Draw) -> str | None:
    labels = [face.label for face in block.module.faces]
    return str(draw.choice(labels)) if labels else None


def _attach(machine: Machine, block: Block, face: str, module: str) -> Actions:
    params = {"base_block": block.id, "face": face, "new_block": module}
    done = act(machine, "attach_block_to", params)
    return [] if done is None else [done]


def _add_block(machine: Machine, category: str, draw: Draw) -> Actions:
    block = _any_block(machine, draw)
    face = _any_face(block, draw)
    return [] if face is None else _attach(machine, block, face, _module(category, draw))


def _add_row(machine: Machine, category: str, draw: Draw) -> Actions:
    """A straight row of blocks, now and then with a part of another kind at its end."""
    block = _any_block(machine, draw)
    face = _any_face(block, draw)
    if face is None:
        return []
    way = np.array(block.face_normal(face))
    made: Actions = []
    count = int(draw.integers(2, 9))
    for k in range(count):
        ahead = _face_towards(block, way)
        if ahead is None:
            break
        module = _module(category, draw) if k == count - 1 else WOOD
        done = _attach(machine, block, ahead, module)
        if not done:
            break
        made += done
        block = machine.blocks[done[0]["makes"]]
    return made


def _face_towards(block: Block, way: NDArray[np.float64]) -> str | None:
    for face in block.module.faces:
        if float(np.array(block.face_normal(face.label)) @ way) > 0.999:
            return str(face.label)
    return None


def _add_mirrored(machine: Machine, category: str, draw: Draw) -> Actions:
    """The same part on a face and on its mirror image east-west or north-south."""
    block = _any_block(machine, draw)
    face = _any_face(block, draw)
    if face is None:
        return []
    module = _module(category, draw)
    axis = int(draw.integers(2))
    middle = next(iter(machine.blocks.values())).center_xyz
    flip = np.ones(3)
    flip[axis] = -1.0
    seat = np.array(block.face_center(face))
    point = middle + flip * (seat - middle)
    way = flip * np.array(block.face_normal(face))
    made = _attach(machine, block, face, module)
    for other in list(machine.blocks.values()):
        label = _face_towards(other, way)
        if label and np.linalg.norm(np.array(other.face_center(label)) - point) < 0.01:
            made += _attach(machine, other, label, module)
            break
    return made


def _connect(machine: Machine, category: str, draw: Draw) -> Actions:
    """One to four connectors between the same two faces."""
    del category
    first, second = _any_block(machine, draw), _any_block(machine, draw)
    face_a, face_b = _any_face(first, draw), _any_face(second, draw)
    if face_a is None or face_b is None:
        return []
    params = {
        "block_a": first.id,
        "face_a": face_a,
        "block_b": second.id,
        "face_b": face_b,
        "connector": "Brace" if draw.random() < 0.8 else "Winch",
    }
    count = 1 if draw.random() < 0.7 else int(draw.integers(2, 5))
    return [done for _ in range(count) if (done := act(machine, "connect_blocks", params))]


def _move(machine: Machine, category: str, draw: Draw) -> Actions:
    """Twists, shifts or flips a part, once or often enough to take it off its face."""
    del category
    block = _any_block(machine, draw)
    kind = draw.random()
    params: dict[str, Any] = {"block_id": block.id}
    if kind < 0.5:
        op, count = "twist_block", 1
        params["angle"] = int(draw.choice(_ANGLES))
    elif kind < 0.85 or not block.module.spins:
        op, count = "shift_block", int(draw.integers(1, 4))
        params["shift_real"] = [float(draw.choice(_SHIFTS)) for _ in range(3)]
    else:
        op, count = "flip_spin", 1
    return [done for _ in range(count) if (done := act(machine, op, params))]


def _bind(machine: Machine, category: str, draw: Draw) -> Actions:
    """Binds all powered parts without a key, or one more, to one key; may press it."""
    powered = [block for block in machine.blocks.values() if block.module.actions]
    if not powered:
        return []
    key = str(draw.choice(_KEYS))
    if draw.random() < 0.5:
        powered = [powered[int(draw.integers(len(powered)))]]
    made = []
    for block in powered:
        action = str(draw.choice(block.module.actions))
        params = {"block_id": block.id, "action": action, "new_key": key}
        done = act(machine, "add_control_key", params)
        made += [] if done is None else [done]
    driven = _GROWTHS[category] is _DRIVEN
    return made + (_press(machine, category, draw, key) if driven else [])


def _press(machine: Machine, category: str, draw: Draw, key: str | None = None) -> Actions:
    del category
    params = {
        "time": round(float(draw.uniform(0.2, 5.0)), 2),
        "key": key or str(draw.choice(_KEYS)),
        "hold_for": round(float(draw.choice((0.1, 0.3, 1.0, 3.0, 8.0))), 2),
    }
    done = act(machine, "add_control_sequence", params)
    return [] if done is None else [done]


_SHAPES: Final[tuple[tuple[Mutation, float], ...]] = (
    (_add_block, 3.0),
    (_add_row, 3.0),
    (_add_mirrored, 2.0),
    (_connect, 2.0),
    (_move, 1.5),
)
_DRIVEN: Final = (*_SHAPES, (_bind, 2.0), (_press, 1.0))
_GROWTHS: Final[Mapping[str, tuple[tuple[Mutation, float], ...]]] = MappingProxyType(
    {
        "support": _SHAPES,
        "transport": _DRIVEN,
        "lift": (*_SHAPES, (_bind, 1.5)),
        "mechanisms": _DRIVEN,
        "flight": _DRIVEN,
        "control": _SHAPES,
        "throwing": _DRIVEN,
        "driving": _DRIVEN,
        "delivering": _DRIVEN,
    }
)
