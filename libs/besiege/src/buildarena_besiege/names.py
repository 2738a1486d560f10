"""The game's own names and numbers for what machine files hold."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from buildarena_geometry.modules.module import Module

START, CARGO = 0, 35

_TYPE_NAMES: Final[Mapping[int, str]] = MappingProxyType(
    {
        START: "StartingBlock",
        15: "SingleWoodenBlock",
        2: "Wheel",
        7: "Brace",
        45: "Winch",
        47: "Torch",
        56: "WaterCannon",
        CARGO: "Ballast",
    }
)
SETTINGS: Final = frozenset(
    {
        *("flipped", "bmt-version", "bmt-speed", "bmt-acceleration", "bmt-automatic"),
        *("bmt-toggle-mode", "bmt-auto-brake", "bmt-opt-collider", "bmt-hold-to-fire"),
        *("bmt-strength", "bmt-mass", "bmt-fthrust", "bmt-slider", "bmt-toggle", "bmt-range"),
        *("bmt-rotation-speed", "bmt-limits", "bmt-spring", "bmt-damper", "bmt-duration"),
        *("bmt-charge", "bmt-power", "bmt-rate-of-fire"),
    }
)
"""Settings of blocks, besides key lists, that public files, converters and registries name."""

MACHINE_SETTINGS: Final = (
    "requiredMods",
    "tracker.enabled",
    "tracker.sample_rate_hz",
    "tracker.target_guids",
    "tracker.output_basename",
)
"""Entries of a machine's own data that public files have, besides its script."""

CARGO_ID: Final = "Ballast"
"""Name of the cargo in logs and canonical forms, in place of a block's id."""


def type_name(module: Module) -> str:
    """Return the name of a type in reference keys: the game's name without blanks."""
    name = _TYPE_NAMES.get(module.besiege.id)
    return name or "".join(c for c in module.name if c.isascii() and c.isalnum()) or "Block"


def key_entries(module: Module) -> dict[str, str]:
    """Return the entry that holds the keys of each of a module's actions."""
    if module.besiege.keys:
        return dict(module.besiege.keys)
    entries: dict[str, str] = {}
    if module.motor is not None:
        entries[module.motor.forward] = "bmt-forward"
        entries[module.motor.backward] = "bmt-backward"
    if module.thrust is not None:
        entries[module.thrust.action] = "bmt-shoot"
    return entries
