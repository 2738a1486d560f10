"""Control without senses: timelines of channels that become keys, and what becomes a timeline."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from msgspec import Meta

from buildarena_besiege.errors import MachineNotPlayableError
from buildarena_besiege.exporting.machine_file import parts_in_file_order
from buildarena_besiege.keys import bindings_of, bound_presses, united
from buildarena_besiege.timeline import (
    SCHEMA,
    channel_of,
    control_timeline,
    event,
    timeline_bytes,
)
from buildarena_geometry.blocks import Block, KeyPress
from buildarena_geometry.errors import DocumentError
from buildarena_geometry.json_texts import read_json
from buildarena_geometry.keys import KEYS
from buildarena_geometry.reading import Form, Whole, read, shown
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.controllers.answers import Channels, near_names
from buildarena_simulation.controllers.program import Program
from buildarena_simulation.errors import ControllerFailed
from buildarena_simulation.fields import MAX_DURATION_S
from buildarena_simulation.machine import bindings_of as actions_of
from buildarena_simulation.machine import part_ids, structure_of

if TYPE_CHECKING:
    from buildarena_geometry import Machine

MAX_EVENTS: Final = 20_000
ON_ABOVE: Final = 0.5
"""A key is down while a channel's value is above it: a key knows no shares."""
_DECIMALS: Final = 6


class _Event(Form, frozen=True, kw_only=True):
    time: Annotated[float, Meta(ge=0.0, le=MAX_DURATION_S)]
    block: Whole
    channel: str
    value: Annotated[float, Meta(ge=0.0, le=1.0)]


class _Timeline(Form, frozen=True, kw_only=True):
    schema: Literal["buildarena.control_timeline.v2"]
    events: list[_Event]


_Spans = tuple[tuple[float, float], ...]
_Part = tuple[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class TimedMachine:
    """A machine that does what a timeline says.

    Attributes:
        machine: With the keys and the control sequence for it, and nothing else that acts.
        shares: How many events had a value between 0 and 1, which keys do not have.
    """

    machine: Machine
    shares: int


def machine_with_timeline(machine: Machine, data: bytes, *, where: str) -> TimedMachine:
    """A copy of a machine whose keys do what a timeline says.

    Channels that are on at the same times share a key. What a machine had of keys, presses and
    program is replaced: the timeline is all that acts.

    Args:
        machine: The machine.
        data: A timeline of schema v2, JSON.
        where: What messages call it.

    Raises:
        DocumentError: It is none, names a block or channel that there is not, or needs more keys
            than there are; the message has what is valid.
    """
    events = _events(data, where)
    actions: dict[_Part, list[_Event]] = {}
    for index, entry in enumerate(events):
        part = _part(machine, entry, f"{where}.events[{index}]")
        actions.setdefault(part, []).append(entry)
    by_spans: dict[_Spans, list[_Part]] = {}
    for part, entries in actions.items():
        spans = _spans(entries)
        if spans:
            by_spans.setdefault(spans, []).append(part)
    if len(by_spans) > len(KEYS):
        raise DocumentError(
            f"{where}: {len(by_spans)} channels are on at times of their own; "
            f"there are {len(KEYS)} keys"
        )
    keys: dict[_Part, str] = {}
    presses = []
    for key, (spans, parts) in zip(KEYS, by_spans.items(), strict=False):
        keys.update(dict.fromkeys(parts, key))
        presses += [
            KeyPress(time_s=start, key=key, hold_for_s=round(end - start, _DECIMALS))
            for start, end in spans
        ]
    presses.sort(key=lambda press: (press.time_s, press.key))
    return TimedMachine(
        machine=_controlled(machine, keys, tuple(presses)),
        shares=sum(0.0 < entry.value < 1.0 for entry in events),
    )


def timeline_of(machine: Machine, *, seconds: float) -> bytes:
    """What a machine does without looking, as a timeline.

    Args:
        machine: With keys, or a program that reads no sense.
        seconds: For how long a program is asked.

    Raises:
        MachineNotPlayableError: Nothing acts, an action has no channel, or the program looks.
        ControllerFailed: The program fails otherwise.
    """
    numbers = {part.id: number for number, part in enumerate(parts_in_file_order(machine), 1)}
    if machine.controller:
        events = _program_events(machine, numbers, seconds)
        return timeline_bytes({"schema": SCHEMA, "events": events})
    presses = bound_presses(machine.control_sequence, machine)
    if not presses:
        raise MachineNotPlayableError("the machine has no key presses that reach an action")
    changes = {
        key: united([(p.time_s, p.time_s + p.hold_for_s) for p in presses if p.key == key])
        for key in {press.key for press in presses}
    }
    key_changes = sorted(
        (round(at, _DECIMALS), key, down)
        for key, spans in changes.items()
        for span in spans
        for at, down in zip(span, (True, False), strict=True)
    )
    return timeline_bytes(
        control_timeline(machine, key_changes, bindings_of(machine, None), numbers)
    )


def _program_events(
    machine: Machine, numbers: dict[str, int], seconds: float
) -> list[dict[str, Any]]:
    program = Program(machine.controller)
    program.sense_nothing()
    structure, ids = structure_of(machine), part_ids(machine)
    channels = Channels(structure, actions_of(machine), ids)
    before: dict[tuple[int, str], float] = {}
    events = []
    for tick in range(round(seconds * SAMPLE_RATE_HZ)):
        time_s = tick / SAMPLE_RATE_HZ
        try:
            levels = channels.levels(program.answer(tick, time_s, ()))
        except ControllerFailed as failure:
            if not program.looked:
                raise
            where = "the program" if failure.line is None else f"line {failure.line} of the program"
            raise MachineNotPlayableError(
                f"{where} reads a sense at {time_s:.2f} s: a timeline is of one that reads none"
            ) from failure
        now = {
            key: round(level, _DECIMALS) if channels.takes_share(*key) else float(level > ON_ABOVE)
            for key, level in levels.items()
        }
        for key in sorted(before.keys() | now.keys()):
            value = now.get(key, 0.0)
            if value != before.get(key, 0.0):
                part, action = ids[key[0]], key[1]
                channel = channel_of(machine, part, action)
                events.append(event(time_s, numbers[part], channel, value))
        before = now
    return events


def _events(data: bytes, where: str) -> list[_Event]:
    try:
        content = read_json(data.decode("utf-8-sig"))
    except ValueError as error:
        raise DocumentError(f"{where}: not valid JSON: {error}") from error
    events = read(content, _Timeline, where=where, error=DocumentError).events
    if len(events) > MAX_EVENTS:
        raise DocumentError(f"{where}: {len(events):,} events; at most {MAX_EVENTS:,} are read")
    return events


def _part(machine: Machine, entry: _Event, place: str) -> _Part:
    """The block and the action that an event is about."""
    parts = parts_in_file_order(machine)
    if not 1 <= entry.block <= len(parts):
        raise DocumentError(
            f"{place}.block: there is no block {entry.block}; the machine's file has "
            f"{'none' if not parts else f'1 to {len(parts)}'}"
        )
    part = parts[entry.block - 1]
    channels = _channels(machine, part) if isinstance(part, Block) else {}
    if entry.channel in channels:
        return part.id, channels[entry.channel]
    near = near_names(entry.channel, channels)
    meant = f"did you mean {' or '.join(near)}? " if near else ""
    raise DocumentError(
        f"{place}.channel: block {entry.block} ({part.module.name}, {part.id} here) has no "
        f"channel {shown(entry.channel)}; {meant}It has {', '.join(channels) or 'none'}"
    )


def _channels(machine: Machine, block: Block) -> dict[str, str]:
    """The actions of a block by their channels; those without one are left out."""
    channels = {}
    for action in block.module.actions:
        try:
            channels[channel_of(machine, block.id, action)] = action
        except MachineNotPlayableError:
            continue
    return channels


def _spans(entries: list[_Event]) -> _Spans:
    """From when to when a channel is on; of two events at one time the later in the list counts."""
    at = {entry.time: entry.value > ON_ABOVE for entry in entries}
    spans, since = [], None
    for time_s, on in sorted(at.items()):
        if on and since is None:
            since = time_s
        elif not on and since is not None:
            spans.append((since, time_s))
            since = None
    if since is not None and since < MAX_DURATION_S:
        spans.append((since, MAX_DURATION_S))
    return tuple(spans)


def _controlled(machine: Machine, keys: dict[_Part, str], presses: tuple[KeyPress, ...]) -> Machine:
    state = machine.state
    blocks = {
        block.id: replace(
            block,
            bindings={
                action: (keys[block.id, action],) if (block.id, action) in keys else ()
                for action in block.bindings
            },
        )
        for block in state.blocks.values()
    }
    links = {
        link.id: replace(link, bindings=dict.fromkeys(link.bindings, ()))
        for link in state.connectors.values()
    }
    after = replace(state, blocks=blocks, connectors=links, control_sequence=presses, controller="")
    return machine.restored(replace(machine.logged, state=after))
