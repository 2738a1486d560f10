"""Machine documents as they are kept: one spelling per machine, so that equal ones share a hash."""

from __future__ import annotations

import json

from buildarena_geometry import Machine


def machine_bytes(machine: Machine) -> bytes:
    """The machine's document with sorted keys and no spaces, as UTF-8."""
    return json.dumps(
        machine.to_document(), ensure_ascii=False, sort_keys=True, separators=(",", ":")
    ).encode()
