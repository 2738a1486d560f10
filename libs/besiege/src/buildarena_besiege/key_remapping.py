"""Own keys of files, which may be any of the game, and keys of ours in their place."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from buildarena_besiege.errors import MachineNotPlayableError
from buildarena_besiege.importing.machine import ImportedMachine
from buildarena_besiege.names import key_entries
from buildarena_geometry import Machine
from buildarena_geometry.blocks import Block
from buildarena_geometry.feedback.words import caption
from buildarena_geometry.keys import KEYS


def remap_keys(imported: ImportedMachine) -> tuple[Machine, Mapping[str, str]]:
    """Return a copy of a machine with valid keys in place of the file's other keys.

    Args:
        imported: Machine as it was read from a file.

    Returns:
        The machine, and the new key for each of the file's; valid keys stay.

    Raises:
        MachineNotPlayableError: It has more keys than are available.
    """
    bound = list(_bound(imported))
    used = [key for _, _, key in bound if key in KEYS]
    foreign = [key for key in dict.fromkeys(key for _, _, key in bound) if key not in KEYS]
    free = [key for key in KEYS if key not in used]
    if len(foreign) > len(free):
        raise MachineNotPlayableError(
            f"the machine has {len(foreign)} keys that machines here lack; {len(free)} are free"
        )
    ours = dict(zip(foreign, free, strict=False))
    keyed = imported.machine.copy()
    for block, action, key in bound:
        if key in ours:
            keyed.act(
                "add_control_key", {"block_id": block.id, "action": action, "new_key": ours[key]}
            )
    return keyed, {**{key: key for key in dict.fromkeys(used)}, **ours}


def lines_of_keys(imported: ImportedMachine) -> tuple[str, ...]:
    """Describe each of the file's other keys in a line: its blocks and their actions."""
    does: dict[str, list[str]] = {}
    for block, action, key in _bound(imported):
        does.setdefault(key, []).append(f"{block.id} {action}{_pushed(block, action)}")
    return tuple(f"{key}: {', '.join(actions)}" for key, actions in does.items())


def _bound(imported: ImportedMachine) -> Iterator[tuple[Block, str, str]]:
    """Yield each block, action and key of the file."""
    for block in imported.machine.blocks.values():
        own = imported.own_keys.get(block.id, {})
        for action in key_entries(block.module):
            keys = own.get(action) or block.bindings.get(action, ())
            for key in dict.fromkeys(keys):
                yield block, action, key


def _pushed(block: Block, action: str) -> str:
    push = block.module.push
    if push is None or action not in {push.action, push.reverse}:
        return ""
    x, y, z = block.world_from_block.direction(push.direction)
    sign = 1.0 if action == push.action else -1.0
    return f" (pushes it {caption((sign * x, sign * y, sign * z))})"
