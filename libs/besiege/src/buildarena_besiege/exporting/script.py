"""Writes the Lua script that plays a trial and reports it.

It runs in Lua 5.1 to 5.5 and in the mod's own 5.2: no integer division, no bit operators, no goto,
no escapes but decimal ones. The mod's functions are fields of plain tables and are called with a
dot; with a colon the table itself would become the first argument.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from buildarena_besiege.checksums import FACTOR, MODULUS
from buildarena_besiege.exporting.lua_texts import lua_text
from buildarena_besiege.keys import UPDATES_PER_S, Edge
from buildarena_simulation.scenario import Cargo

SAMPLE_EVERY: Final = 4
"""Updates from one sample to the next: 25 samples a second."""

BEGIN_EVERY: Final = 50
"""Updates from one repetition of the begin line to the next: the window loses its oldest lines."""

END_EVERY: Final = 25
"""Updates from one repetition of the end line to the next."""

BLOCKS_PER_LINE: Final = 8
"""Maximum blocks per line, for the width of the log window."""

EARLY_UPDATES: Final = 60
"""Updates whose lines are printed again: the first copies of the window lose its oldest lines."""

EARLY_AGAIN: Final = (100, 200)
"""Updates in which they are printed again."""

MAX_EARLY_LINES: Final = 150
"""Maximum number of lines printed again: half of the log window's."""

FIRST_BLOCK: Final = "0"
"""Name of the machine's first block in the script, as the mod gives it no reference key."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reported:
    """A block that the script reports.

    Attributes:
        reference: reference key; "0" for the machine's first block.
        burns: true if the script also reports if it burns.
        cargo: true for the cargo, whose mass is reported.
    """

    reference: str
    burns: bool = False
    cargo: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Telling:
    """Report of a script, and its markers for lines.

    Attributes:
        prefix: beginning of every line.
        begin: fields of the begin line after its kind.
        last_update: last update of the trial.
        blocks: blocks to report, in this order.
        probes: points at which it measures the ground's height, (east, north) in units.
        ray_start: height at which the rays begin, units.
    """

    prefix: str
    begin: str
    last_update: int
    blocks: tuple[Reported, ...]
    probes: tuple[tuple[float, float], ...] = ()
    ray_start: float = 0.0


def script_text(
    header: Sequence[str],
    edges: Sequence[Edge],
    *,
    cargo: Cargo | None = None,
    cargo_reference: str = "",
    telling: Telling | None = None,
    pilot: str = "",
) -> str:
    """Return a trial's script.

    Args:
        header: Comment lines, without line ends.
        edges: Edges of the keys in order of time.
        cargo: Cargo whose mass grows, if any.
        cargo_reference: Reference key of the cargo.
        telling: Report of the script. Defaults to none.
        pilot: Lua that runs a program in place of the edges, see `pilot_lua`.
    """
    parts = [*(f"-- {line}" for line in header), _STATE, _keys(edges)]
    if cargo is not None:
        parts.append(_cargo(cargo, cargo_reference))
    if telling is not None:
        parts += [_telling_tables(telling), _REPORT]
    if pilot:
        parts.append(pilot)
    calls = ["  updates = updates + 1", "  pilot()" if pilot else "  move_keys()"]
    if cargo is not None:
        calls.insert(1, "  weigh()")
    if telling is not None:
        calls.append("  report()")
    play = "  cargo = machine.get_refs_control(cargo_key)" if cargo is not None else ""
    parts.append(_ENDING.replace("--PLAY--", play).replace("--CALLS--", "\n".join(calls)))
    return "\n".join(part.strip("\n") for part in parts) + "\n"


def _keys(edges: Sequence[Edge]) -> str:
    names = list(dict.fromkeys(edge.key for edge in edges))
    rows = [
        f"  {{{edge.update}, {names.index(edge.key) + 1}, {str(edge.down).lower()}}},"
        for edge in edges
    ]
    emulators = [f"  machine.new_key_emulator({lua_text(name)})," for name in names]
    return "\n".join(["local keys = {", *emulators, "}", "local edges = {", *rows, "}", _MOVE_KEYS])


def _cargo(cargo: Cargo, reference: str) -> str:
    return _WEIGH.format(
        key=lua_text(reference),
        least=repr(float(cargo.initial_mass)),
        growth=f"({float(cargo.final_mass)!r} - {float(cargo.initial_mass)!r})",
        start=repr(float(cargo.ramp_start_s)),
        ramp=repr(float(cargo.ramp_s)),
        rate=UPDATES_PER_S,
    )


def _telling_tables(telling: Telling) -> str:
    rows = [
        f"  {{{_reference(block)}, {str(block.burns).lower()}, {str(block.cargo).lower()}}},"
        for block in telling.blocks
    ]
    return "\n".join(
        [
            f"local prefix = {lua_text(telling.prefix)}",
            f"local begin = {lua_text(telling.begin)}",
            f"local begin_every = {BEGIN_EVERY}",
            f"local last = {telling.last_update}",
            f"local per_line = {BLOCKS_PER_LINE}",
            f"local sample_every, end_every = {SAMPLE_EVERY}, {END_EVERY}",
            f"local early_last, max_early = {EARLY_UPDATES}, {MAX_EARLY_LINES}",
            f"local again = {{{', '.join(f'[{update}] = true' for update in EARLY_AGAIN)}}}",
            f"local ray_start = {telling.ray_start!r}",
            "local probes = {",
            *(f"  {{{east!r}, {north!r}}}," for east, north in telling.probes),
            "}",
            f"local factor, modulus = {FACTOR}, {MODULUS}",
            "local blocks = {",
            *rows,
            "}",
        ]
    )


def _reference(block: Reported) -> str:
    return reference_lua(block.reference)


def reference_lua(reference: str) -> str:
    """Return the script's name of a block, as Lua."""
    return FIRST_BLOCK if reference == FIRST_BLOCK else lua_text(reference)


_STATE = """
local updates = 0
"""

_MOVE_KEYS = """
local next_edge = 1

local function move_keys()
  while edges[next_edge] ~= nil and edges[next_edge][1] <= updates do
    local edge = edges[next_edge]
    if edge[3] then
      keys[edge[2]].start()
    else
      keys[edge[2]].stop()
    end
    next_edge = next_edge + 1
  end
end
"""

_WEIGH = """
local cargo_key = {key}
local cargo = nil
local mass = {least}

local function weigh()
  local share = math.max(math.min((updates / {rate} - {start}) / {ramp}, 1), 0.005)
  mass = {least} + {growth} * share
  cargo.set_slider("mass", mass)
end
"""

# Decimals are put together from whole numbers: %f ignores its precision in the mod's Lua, and what
# it writes depends on the computer's language. Characters are summed eight at a time, two to a
# division: calls are slow in the mod's Lua, and nothing leaves the doubles' whole numbers.
_REPORT = """
local floor, format, sub, byte, len = math.floor, string.format, string.sub, string.byte, string.len
local early, early_size = {}, 0

local function decimals(value)
  if value ~= value or value > 200000 or value < -200000 then
    return "nan"
  end
  local sign = ""
  if value < 0 then
    sign = "-"
    value = -value
  end
  local digits = format("%d", floor(value * 10000 + 0.5))
  local count = len(digits)
  if count < 5 then
    digits = sub("00000", count + 1) .. digits
    count = 5
  end
  return sign .. sub(digits, 1, count - 4) .. "." .. sub(digits, count - 3)
end

local function tell(text)
  local line = prefix .. text
  local size = len(line)
  local sum = 0
  for i = 1, size - 7, 8 do
    local a, b, c, d, e, f, g, h = byte(line, i, i + 7)
    sum = ((sum * factor + a + 1) * factor + b + 1) % modulus
    sum = ((sum * factor + c + 1) * factor + d + 1) % modulus
    sum = ((sum * factor + e + 1) * factor + f + 1) % modulus
    sum = ((sum * factor + g + 1) * factor + h + 1) % modulus
  end
  for i = size - size % 8 + 1, size do
    sum = (sum * factor + byte(line, i) + 1) % modulus
  end
  line = line .. "," .. format("%d", sum)
  if updates <= early_last and early_size < max_early then
    early_size = early_size + 1
    early[early_size] = line
  end
  print(line)
end

local function ground(place)
  local from = {x = place[1], y = ray_start, z = place[2], w = 0}
  local hit = physics.raycast(from, {x = 0, y = -1, z = 0, w = 0})
  if hit == nil then
    return "-"
  elseif hit.is_block then
    return "b"
  end
  return decimals(hit.point.y)
end

local function measured()
  local count = "-"
  if entities ~= nil then
    count = format("%d", floor(entities.count()))
  end
  local text = ",w," .. decimals(physics.gravity().y) .. "," .. count
    .. "," .. format("%d", floor(screen.width())) .. "," .. format("%d", floor(screen.height()))
  for index = 1, #probes do
    text = text .. "," .. ground(probes[index])
  end
  return text
end

local level = ""
local positions, destroyed, burning, heads, places = {}, {}, {}, {}, {}

local function look_up()
  local info = machine.get_machine_info()
  for index = 1, #blocks do
    local found = info.get_block_info(blocks[index][1])
    positions[index] = found.position
    destroyed[index] = found.destroyed
    burning[index] = found.burning
    heads[index] = "," .. format("%d", index) .. ","
    places[index] = "nan,nan,nan"
  end
end

local function entry(index)
  if destroyed[index]() then
    return heads[index] .. "x," .. places[index]
  end
  local place = positions[index]()
  local where = decimals(place.x) .. "," .. decimals(place.y) .. "," .. decimals(place.z)
  places[index] = where
  local state = "-"
  if blocks[index][3] then
    state = decimals(mass)
  elseif blocks[index][2] then
    state = burning[index]() and "1" or "0"
  end
  return heads[index] .. state .. "," .. where
end

local function sample()
  local count = #blocks
  local parts = math.max(math.ceil(count / per_line), 1)
  for part = 1, parts do
    local text = ",s," .. format("%d", updates) .. "," .. format("%d", part)
      .. "," .. format("%d", parts)
    for index = (part - 1) * per_line + 1, math.min(part * per_line, count) do
      text = text .. entry(index)
    end
    tell(text)
  end
end

local function report()
  if updates == 1 then
    look_up()
    level = measured()
  end
  if updates == 1 or (updates % begin_every == 0 and updates <= last) then
    tell(",b," .. begin)
    tell(level)
  end
  if updates % sample_every == 0 and updates <= last then
    sample()
  end
  if again[updates] then
    for index = 1, early_size do
      print(early[index])
    end
  end
  if updates >= last and (updates - last) % end_every == 0 then
    tell(",e," .. format("%d", updates))
  end
end
"""

_ENDING = """
local function play()
--PLAY--
end

local function update()
end

local function late_update()
end

local function fixed_update()
--CALLS--
end

local function on_gui()
end

return {
  play = play,
  update = update,
  late_update = late_update,
  fixed_update = fixed_update,
  on_gui = on_gui,
}
"""
