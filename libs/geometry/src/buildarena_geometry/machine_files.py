"""Machines from JSON files that people hand over: machine documents and action logs."""

import json
from collections.abc import Mapping
from typing import Any

from buildarena_geometry.dialects import Dialect, dialect, dialects
from buildarena_geometry.errors import DocumentError
from buildarena_geometry.machine import Machine
from buildarena_geometry.modules.sets import module_set


def machine_of(content: object, *, where: str, version: str | None = None) -> Machine:
    """Return the machine of a file's JSON values.

    Args:
        content: A machine document; a list of actions ({"op", "params"} or {"name", "arguments"});
            or an object with such a list under "actions" or "steps" and, for an assembly, the
            lists of its sub-structures by name under "sub_structures" or "sub_machines".
        where: Name of the file in messages.
        version: Dialect of an action log, see `dialects`. Defaults to the one in which every action
            is accepted.

    Raises:
        DocumentError: It is none of these, the document is wrong, or an action of the log is
            refused.
        ValueError: The dialect is unknown.
    """
    if isinstance(content, dict) and "blocks" in content:
        return Machine.from_document(content)
    if isinstance(content, list):
        content = {"actions": content}
    actions = content.get("actions", content.get("steps")) if isinstance(content, dict) else None
    if not isinstance(content, dict) or not isinstance(actions, list):
        raise DocumentError(f"{where}: neither a machine document nor an action log")
    parts = content.get("sub_structures", content.get("sub_machines")) or {}
    if not isinstance(parts, dict):
        raise DocumentError(f"{where}: sub_structures is an object of action logs by name")
    refusals = []
    for name in dialects() if version is None else (version,):
        try:
            return _assembled(actions, parts, where, dialect(name))
        except _ActionRefusedError as refused:
            refusals.append((refused.accepted, name, refused))
    _, name, furthest = max(refusals, key=lambda refusal: refusal[0])
    read_as = f"read as dialect {name}, of {', '.join(dialects())}"
    raise DocumentError(f"{furthest}; {read_as}") from furthest


def machine_bytes(machine: Machine) -> bytes:
    """Encode a machine's document canonically, so that equal ones share a hash: UTF-8 JSON."""
    document = machine.to_document()
    text = json.dumps(document, ensure_ascii=False, sort_keys=True, separators=(",", ":"))
    return text.encode()


class _ActionRefusedError(DocumentError):
    """An action of a log is refused; `accepted` ones of all its lists came before."""

    def __init__(self, message: str, accepted: int) -> None:
        super().__init__(message)
        self.accepted = accepted


def _assembled(
    actions: list[Any], parts: Mapping[str, object], where: str, speaking: Dialect
) -> Machine:
    built: dict[str, Machine] = {}
    accepted = 0
    for name, log in parts.items():
        built[name] = _built(log, {}, f"{where}, {name}", speaking, accepted)
        accepted += len(built[name].log.records)
    return _built(actions, built, where, speaking, accepted)


def _built(
    actions: object, available: dict[str, Machine], where: str, speaking: Dialect, accepted: int
) -> Machine:
    """Build the machine of a log."""
    if not isinstance(actions, list) or not all(isinstance(action, dict) for action in actions):
        raise DocumentError(f"{where}: an action log is a list of objects")
    machine = Machine(catalogue=module_set("all"), available=available)
    for number, action in enumerate(actions, start=1):
        name = action.get("op", action.get("name"))
        arguments = action.get("params", action.get("arguments"))
        if isinstance(arguments, dict):
            arguments = speaking.ours(arguments, machine)
        outcome = machine.act(name, arguments)
        if not outcome.ok:
            problem = f"{where}: action {number}, {name}, is refused: {outcome.text}"
            raise _ActionRefusedError(problem, accepted + number - 1)
    return machine
