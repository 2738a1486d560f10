"""Machine files for the stand-in game, written from machines of ours without our exporter."""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape

from buildarena_geometry import Block, Connector, Machine
from buildarena_geometry.besiege_components import (
    besiege_point,
    besiege_rotation,
    besiege_span,
)

_ENTRIES = {
    "spinning_forward": "bmt-forward",
    "spinning_backward": "bmt-backward",
    "hold_to_fire": "bmt-shoot",
}
_TYPES = {
    "Starting Block": 0,
    "Powered Wheel": 2,
    "Brace": 7,
    "Small Wooden Block": 15,
    "Winch": 45,
    "Torch": 47,
    "Water Cannon": 56,
}
CARGO = "cargo"
STRAIGHT = (0.0, 0.0, 0.0, 1.0)
QUARTER = (0.0, 0.70710678, 0.0, 0.70710678)

Vector = tuple[float, float, float]


def machine_file(
    machine: Machine,
    *,
    script: str | None = None,
    position: Vector = (0.0, 5.0, 0.0),
    rotation: tuple[float, float, float, float] = STRAIGHT,
    cargo: tuple[Vector, Vector] | None = None,
    turned_ends: bool = True,
) -> str:
    """The text of a machine file; a block's reference key is its id.

    Args:
        machine: the machine.
        script: its Lua script.
        position: of Global, the game's components.
        rotation: of Global, x, y, z, w.
        cargo: root in the machine frame and scale of a cargo, the game's components.
        turned_ends: whether connectors say how their ends' faces are turned; games write it.
    """
    parts = [*machine.blocks.values(), *machine.connectors.values()]
    blocks = "".join(_block(machine, part, turned_ends=turned_ends) for part in parts)
    if cargo is not None:
        root, scale = cargo
        up = (-0.7071067811865476, 0.0, 0.0, 0.7071067811865475)
        entries = '<Single key="bmt-mass">5.0</Single>'
        blocks += _element(35, (root, up, scale), entries, CARGO)
    lua = ""
    if script is not None:
        lua = (
            '<StringArray key="lua_files">LuaRoot/main.lua</StringArray>'
            f'<StringArray key="lua_data">{escape(script, quote=False)}</StringArray>'
            '<Boolean key="lua">True</Boolean>'
        )
    return (
        '<?xml version="1.0" encoding="utf-8"?><!--A machine.-->'
        '<Machine version="1" bsgVersion="1.4" name="m"><Global>'
        f"{_vector('Position', position)}{_vector('Rotation', rotation)}</Global>"
        f'<Data>{lua}<StringArray key="requiredMods" /></Data><Blocks>{blocks}</Blocks></Machine>'
    )


def reporting(
    ids: list[str], *, keys: Mapping[str, tuple[float, float]] | None = None, top_mass: float = 0
) -> str:
    """A script that prints blocks' places 25 times a second, with all digits.

    Args:
        ids: the blocks.
        keys: keys with when they are pressed and let go, seconds.
        top_mass: where the cargo's mass ramps to, as the published script's; 0 leaves it alone.
    """
    lines = ["local n = 0", "local info = machine.get_machine_info()"]
    lines += [f"local key_{key} = machine.new_key_emulator('{key}')" for key in keys or {}]
    if top_mass:
        lines.append(f"local cargo = machine.get_refs_control('{CARGO}')")
    lines.append("local function fixed_update()\n  n = n + 1\n  local t = n / 100")
    if top_mass:
        share = "math.max(math.min((t - 0.5) / 2, 1), 0.005)"
        lines.append(f"  cargo.set_slider('mass', 5 + {top_mass - 5} * {share})")
    for key, (start, end) in (keys or {}).items():
        lines.append(f"  if t >= {start} then key_{key}.start() end")
        lines.append(f"  if t >= {end} then key_{key}.stop() end")
    lines.append("  if n % 4 == 0 then")
    for name in ids:
        lines.append(f"    local p = info.get_block_info('{name}')")
        lines.append("    local c = p.position()")
        lines.append(
            f"    print(string.format('%d, {name}, %.6f, %.6f, %.6f, %s', "
            "n, c.x, c.y, c.z, tostring(p.burning())))"
        )
    lines.append("  end\nend")
    lines.append("return {play = function() end, fixed_update = fixed_update}")
    return "\n".join(lines)


def _block(machine: Machine, part: Block | Connector, *, turned_ends: bool) -> str:
    w, x, y, z = besiege_rotation(part)
    if isinstance(part, Connector):
        place, entries = part.world_from_connector.xyz, _span(machine, part, turned=turned_ends)
    else:
        place, entries = part.world_from_block.xyz, _entries(part)
    type_id = _TYPES[part.module.name]
    transform = (besiege_point(place), (x, y, z, w), (1.0, 1.0, 1.0))
    return _element(type_id, transform, entries, part.id)


def _entries(block: Block) -> str:
    entries = "".join(
        f'<StringArray key="{_ENTRIES[action]}">'
        + "".join(f"<String>{key}</String>" for key in keys)
        + "</StringArray>"
        for action, keys in block.bindings.items()
    )
    if block.module.spins:
        entries += f'<Boolean key="flipped">{block.flipped}</Boolean>'
    return entries


def _span(machine: Machine, link: Connector, *, turned: bool) -> str:
    entries = _point("start-position", (0, 0, 0)) + _point("end-position", besiege_span(link))
    if not turned:
        return entries
    x, y, z = besiege_point(machine.blocks[link.end[0]].face_normal(link.end[1]))
    beta, alpha = math.degrees(math.acos(max(-1.0, min(1.0, z)))), math.degrees(math.atan2(y, x))
    return entries + _point("end-rotation", (alpha + 270, beta, 0))


def _element(
    type_id: int,
    transform: tuple[Vector, tuple[float, float, float, float], Vector],
    entries: str,
    name: str,
) -> str:
    place, turn, scale = transform
    return (
        f'<Block id="{type_id}" guid="{name}"><Transform>{_vector("Position", place)}'
        f"{_vector('Rotation', turn)}{_vector('Scale', scale)}</Transform><Data>{entries}"
        f'<String key="bmt-lua_ref_key">{name}</String></Data></Block>'
    )


def _vector(name: str, values: tuple[float, ...]) -> str:
    axes = " ".join(
        f'{axis}="{float(value)!r}"' for axis, value in zip("xyzw", values, strict=False)
    )
    return f"<{name} {axes} />"


def _point(key: str, values: Vector) -> str:
    axes = "".join(
        f"<{axis}>{float(value)!r}</{axis}>" for axis, value in zip("XYZ", values, strict=True)
    )
    return f'<Vector3 key="{key}">{axes}</Vector3>'
