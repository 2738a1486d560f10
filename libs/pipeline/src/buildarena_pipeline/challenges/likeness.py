"""What near-copies share: histories up to names, machines up to guids, as hashes."""

from __future__ import annotations

import hashlib
import json
from typing import Any, Final

from buildarena_besiege.importing.xml_file import FileMachine

_WORDS: Final = frozenset({"note", "name", "machine_name"})
"""Arguments that name things: they make no other machine."""
_DECIMALS: Final = 3


def nameless(action: dict[str, Any]) -> list[Any]:
    """An action without what only names things."""
    arguments = action.get("params", action.get("arguments", {}))
    kept = {name: value for name, value in arguments.items() if name not in _WORDS}
    return [action.get("op", action.get("name")), kept]


def shape_of_file(machine: FileMachine) -> list[Any]:
    """A machine's blocks, in no order: a block and its turn, whichever sign the turn is written."""
    return sorted(
        [block.type, *_rounded(block.position), *_rounded(map(abs, block.rotation))]
        for block in machine.blocks
    )


def _rounded(numbers: Any) -> list[float]:
    return [round(number, _DECIMALS) + 0.0 for number in numbers]


def digest(content: list[Any]) -> str:
    """Hash of JSON values."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
