"""Machines from JSON files that people hand over: machine documents and action logs."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from buildarena_geometry.errors import DocumentError
from buildarena_geometry.machine import Machine

if TYPE_CHECKING:
    from buildarena_geometry.modules.module import Catalogue


def machine_of(content: object, *, where: str, catalogue: Catalogue | None = None) -> Machine:
    """The machine of a file's JSON values.

    Args:
        content: A machine document; a list of actions ({"op", "params"} or {"name", "arguments"});
            or an object with such a list under "actions" or "steps" and, for an assembly, the
            lists of its sub-structures by name under "sub_structures" or "sub_machines".
        where: What messages call the file.
        catalogue: The modules it is made of; the basic ones if left out.

    Raises:
        DocumentError: It is none of these, or the document is wrong.
    """
    if isinstance(content, dict) and "blocks" in content:
        return Machine.from_document(content, catalogue=catalogue)
    if isinstance(content, list):
        content = {"actions": content}
    actions = content.get("actions", content.get("steps")) if isinstance(content, dict) else None
    if not isinstance(content, dict) or not isinstance(actions, list):
        raise DocumentError(f"{where}: neither a machine document nor an action log")
    parts = content.get("sub_structures", content.get("sub_machines")) or {}
    if not isinstance(parts, dict):
        raise DocumentError(f"{where}: sub_structures is an object of action logs by name")
    built = {name: _built(log, {}, f"{where}, {name}", catalogue) for name, log in parts.items()}
    return _built(actions, built, where, catalogue)


def machine_bytes(machine: Machine) -> bytes:
    """A machine's document in one spelling, so that equal ones share a hash: UTF-8 JSON."""
    return json.dumps(
        machine.to_document(), ensure_ascii=False, sort_keys=True, separators=(",", ":")
    ).encode()


def _built(
    actions: object, available: dict[str, Machine], where: str, catalogue: Catalogue | None
) -> Machine:
    """The machine a log builds; refused actions change nothing, as when they were made."""
    if not isinstance(actions, list) or not all(isinstance(action, dict) for action in actions):
        raise DocumentError(f"{where}: an action log is a list of objects")
    machine = Machine(catalogue=catalogue, available=available)
    for action in actions:
        name = action.get("op", action.get("name"))
        machine.act(name, action.get("params", action.get("arguments")))
    return machine
