"""Writes the Lua script that plays a trial and reports it.

It runs in Lua 5.1 to 5.5 and in the mod's own 5.2: no integer division, no bit operators, no goto,
no escapes but decimal ones. The mod's functions are fields of plain tables and are called with a
dot; with a colon the table itself would become the first argument.
"""

from __future__ import annotations

import string
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from buildarena_besiege.check_sums import FACTOR, MODULUS
from buildarena_besiege.keys import UPDATES_PER_S

if TYPE_CHECKING:
    from collections.abc import Sequence

    from buildarena_besiege.keys import Edge
    from buildarena_simulation.scenario import Cargo

SAMPLE_EVERY: Final = 4
"""Updates from one sample to the next: 25 samples a second."""

BEGIN_EVERY: Final = 50
"""Updates from one repetition of the begin line to the next: the window loses its oldest lines."""

END_EVERY: Final = 25
"""Updates from one repetition of the end line to the next."""

BLOCKS_PER_LINE: Final = 8
"""So that no line is too long for the log window."""

_PLAIN: Final = frozenset((string.ascii_letters + string.digits + "_-.,:% ").encode())

FIRST_BLOCK: Final = "0"
"""How the script names the machine's first block; the mod gives that one no reference key."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reported:
    """A block that the script reports.

    Attributes:
        reference: its reference key; "0" for the machine's first block.
        burns: whether the script also reports if it burns.
        cargo: whether it is the cargo, whose mass is reported.
    """

    reference: str
    burns: bool = False
    cargo: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Telling:
    """What a script reports, and how it marks its lines.

    Attributes:
        prefix: what every line begins with.
        begin: the begin line's fields after its kind.
        last_update: the trial's last update.
        blocks: what it reports, in this order.
    """

    prefix: str
    begin: str
    last_update: int
    blocks: tuple[Reported, ...]


def script_text(
    header: Sequence[str],
    edges: Sequence[Edge],
    *,
    cargo: Cargo | None = None,
    cargo_reference: str = "",
    telling: Telling | None = None,
) -> str:
    """A trial's script.

    Args:
        header: Its comment lines, without line ends.
        edges: The keys' edges in order of time.
        cargo: The cargo whose mass grows, if there is one.
        cargo_reference: The cargo's reference key.
        telling: What is reported; nothing if left out.
    """
    parts = [*(f"-- {line}" for line in header), _STATE, _keys(edges)]
    if cargo is not None:
        parts.append(_cargo(cargo, cargo_reference))
    if telling is not None:
        parts += [_telling_tables(telling), _REPORT]
    calls = ["  updates = updates + 1", "  move_keys()"]
    if cargo is not None:
        calls.insert(1, "  weigh()")
    if telling is not None:
        calls.append("  report()")
    play = "  cargo = machine.get_refs_control(cargo_key)" if cargo is not None else ""
    parts.append(_ENDING.replace("--PLAY--", play).replace("--CALLS--", "\n".join(calls)))
    return "\n".join(part.strip("\n") for part in parts) + "\n"


def lua_text(text: str) -> str:
    """A Lua string that means the text, whatever it holds."""
    safe = "".join(
        chr(byte) if byte in _PLAIN else f"\\{byte:03d}" for byte in text.encode("utf-8", "replace")
    )
    return f'"{safe}"'


def _keys(edges: Sequence[Edge]) -> str:
    names = list(dict.fromkeys(edge.key for edge in edges))
    rows = [
        f"  {{{edge.update}, {names.index(edge.key) + 1}, {str(edge.down).lower()}}},"
        for edge in edges
    ]
    made = [f"  machine.new_key_emulator({lua_text(name)})," for name in names]
    return "\n".join(["local keys = {", *made, "}", "local edges = {", *rows, "}", _MOVE_KEYS])


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
            f"local factor, modulus = {FACTOR}, {MODULUS}",
            "local blocks = {",
            *rows,
            "}",
        ]
    )


def _reference(block: Reported) -> str:
    return FIRST_BLOCK if block.reference == FIRST_BLOCK else lua_text(block.reference)


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

# Decimals are put together from whole numbers: what %f writes depends on the computer's language.
_REPORT = """
local function decimals(value)
  if value ~= value or value > 200000 or value < -200000 then
    return "nan"
  end
  local sign = ""
  if value < 0 then
    sign = "-"
    value = -value
  end
  local whole = math.floor(value * 10000 + 0.5)
  local units = math.floor(whole / 10000)
  return sign .. string.format("%d", units) .. "."
    .. string.sub(string.format("%d", 10000 + whole - units * 10000), 2)
end

local function tell(text)
  local line = prefix .. text
  local sum = 0
  for i = 1, string.len(line) do
    sum = (sum * factor + string.byte(line, i) + 1) % modulus
  end
  print(line .. "," .. string.format("%d", sum))
end

local function entry(info, index)
  local block = blocks[index]
  local found = info.get_block_info(block[1])
  local place = found.position()
  local state = "-"
  if block[3] then
    state = decimals(mass)
  elseif block[2] then
    state = found.burning() and "1" or "0"
  end
  return "," .. string.format("%d", index) .. "," .. state .. "," .. decimals(place.x)
    .. "," .. decimals(place.y) .. "," .. decimals(place.z)
end

local function sample()
  local info = machine.get_machine_info()
  local count = #blocks
  local parts = math.max(math.ceil(count / per_line), 1)
  for part = 1, parts do
    local text = ",s," .. string.format("%d", updates) .. "," .. string.format("%d", part)
      .. "," .. string.format("%d", parts)
    for index = (part - 1) * per_line + 1, math.min(part * per_line, count) do
      text = text .. entry(info, index)
    end
    tell(text)
  end
end

local function report()
  if updates == 1 or (updates % begin_every == 0 and updates <= last) then
    tell(",b," .. begin)
  end
  if updates % sample_every == 0 and updates <= last then
    sample()
  end
  if updates >= last and (updates - last) % end_every == 0 then
    tell(",e," .. string.format("%d", updates))
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
