"""Writes the game's level files (.blv): the fixed boxes of a scenario's terrain."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from typing import Final

from buildarena_geometry.besiege_components import besiege_point, besiege_turn
from buildarena_geometry.rotations import NO_ROTATION, Quaternion, Vector, about_axis, rotate
from buildarena_simulation import Scenario
from buildarena_simulation.scenario import TerrainBox

BOX_PREFAB: Final = 7000

_SETTINGS: Final = (
    'EditorVersion="0.9" UseVoting="False" CurtainMode="False" AllowExcessPlayers="True" '
    'HidePlayerLabels="False" AllowCopyMachine="True" allowModMachines="True" Environment="None"'
)
_FREE_FLAGS: Final = (
    "DisableFire",
    "DisableExplosions",
    "DisableProjectiles",
    "ZeroG",
    "InfiniteAmmo",
    "Invincibility",
    "ExplosiveCannonballs",
)


def level_file(scenario: Scenario) -> bytes:
    """Return the level with a scenario's terrain, and nothing else.

    A box's origin is taken to be the middle of its underside.

    Args:
        scenario: Scenario with the terrain; its boxes are written from north to south.
    """
    boxes = sorted(scenario.terrain, key=lambda box: -box.center[1])
    lines = [
        '<?xml version="1.0" encoding="utf-8"?>',
        "<Level>",
        f"    <LevelSettings {_SETTINGS}>",
        *(f'        <{flag} Enabled="False" Locked="False" />' for flag in _FREE_FLAGS),
        '        <DisableBounds Enabled="True" Locked="True" />',
        "    </LevelSettings>",
        "    <CustomData>",
        '        <StringArray key="requiredMods" />',
        "    </CustomData>",
        "    <Objects>",
        *(line for number, box in enumerate(boxes) for line in _object(number, box)),
        "    </Objects>",
        "</Level>",
        "",
    ]
    return "\n".join(lines).encode("utf-8-sig")


def _object(number: int, box: TerrainBox) -> Iterator[str]:
    turn = about_axis((1.0, 0.0, 0.0), box.slope_deg)
    yield f'        <Object ID="{_object_id(number, box)}" Prefab="{BOX_PREFAB}">'
    yield f"            <Position {_vector(besiege_point(_underside(box, turn)))} />"
    if turn != NO_ROTATION:
        w, x, y, z = besiege_turn(turn)
        yield f'            <Rotation x="{x!r}" y="{y!r}" z="{z!r}" w="{w!r}" />'
    yield f"            <Scale {_vector(besiege_point(box.size))} />"
    yield "            <Data>"
    yield '                <Boolean key="bmt-lel-enable-physics">False</Boolean>'
    yield "            </Data>"
    yield "        </Object>"


def _underside(box: TerrainBox, turn: Quaternion) -> Vector:
    x, y, z = box.center
    down = rotate(turn, (0.0, 0.0, -box.size[2] / 2))
    return (x + down[0], y + down[1], z + down[2])


def _object_id(number: int, box: TerrainBox) -> int:
    """Return a signed 64-bit number that depends only on the box and its index."""
    digest = hashlib.sha256(f"{number} {box.model_dump_json()}".encode()).digest()
    # The index in the list has separate bits, so that all ids differ.
    spread = int.from_bytes(digest[:6], "big")
    return (number << 48) + spread - 2**62


def _vector(vector: Vector) -> str:
    x, y, z = (0.0 if math.isclose(value, 0.0, abs_tol=1e-12) else value for value in vector)
    return f'x="{x!r}" y="{y!r}" z="{z!r}"'
