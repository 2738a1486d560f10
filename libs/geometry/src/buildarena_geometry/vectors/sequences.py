"""Runs action sequences in the golden vectors' format."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterator, Mapping
from typing import Any

from msgspec import Struct

from buildarena_geometry.dialects import Dialect
from buildarena_geometry.errors import SequenceError
from buildarena_geometry.json_texts import read_json
from buildarena_geometry.machine import Machine
from buildarena_geometry.modules.module import Catalogue
from buildarena_geometry.outcomes import Cause, Outcome, Refused
from buildarena_geometry.struct_reader import read
from buildarena_geometry.vectors.state import kind_of, state_entry

_GZIP_MAGIC = b"\x1f\x8b"


def run_sequences(
    content: object, *, every_state: bool = True, speaking: Dialect | None = None
) -> Iterator[dict[str, Any]]:
    """Build the machines of some sequences.

    Args:
        content: JSON values: a list of sequences, one sequence, or a bare list of {op, params}.
        every_state: true to include the state after each step, false for that of the last step
            only.
        speaking: dialect of the sequences. Defaults to the native one.

    Yields:
        {"seed", "steps": [{"ok", "kind", "state"}]} for each sequence.

    Raises:
        SequenceError: the content has another form.
    """
    interface = speaking or Dialect()
    for sequence in _sequences(content):
        sources = {name: _Run(interface.catalogue, {}) for name in sequence.sub_machines}
        for name, actions in sequence.sub_machines.items():
            for action in actions:
                sources[name].act(action)
        run = _Run(interface.catalogue, sources)
        done: list[dict[str, Any]] = []
        for number, step in enumerate(sequence.steps, start=1):
            outcome = run.act(step)
            done.append({"ok": outcome.ok, "kind": kind_of(outcome, interface.kinds)})
            if every_state or number == len(sequence.steps):
                done[-1]["state"] = state_entry(run.machine.state, run.order, interface)
        yield {"seed": sequence.seed, "steps": done}


def parse(data: bytes) -> object:
    """Parse a sequence file, plain or compressed by gzip.

    Raises:
        SequenceError: it is not JSON, or damaged.
    """
    try:
        plain = gzip.decompress(data) if data.startswith(_GZIP_MAGIC) else data
        content: object = read_json(plain)
    except (OSError, EOFError, zlib.error) as error:
        raise SequenceError(f"input: not gzip: {error}") from error
    except ValueError as error:
        raise SequenceError(f"input: not JSON: {error}") from error
    return content


class _Step(Struct, frozen=True, kw_only=True):
    op: Any
    params: Any = None


class _Sequence(Struct, frozen=True, kw_only=True):
    seed: Any = None
    sub_machines: dict[str, tuple[_Step, ...]] = {}
    steps: tuple[_Step, ...]


class _Run:
    """A machine on its way through a sequence, with the order the vectors list its parts in.

    That is the order of creation, but for parts that a twist or shift was tried on: the published
    library takes them out and puts them in again at the end.
    """

    def __init__(self, catalogue: Catalogue | None, sources: Mapping[str, _Run]) -> None:
        available = {name: source.machine for name, source in sources.items()}
        self.machine: Machine = Machine(catalogue=catalogue, available=available)
        self._sources = sources
        self.order: list[str] = []

    def act(self, step: _Step) -> Outcome:
        name, arguments = step.op, step.params
        outcome = self.machine.act(name, arguments)
        parts = [part.id for part in self.machine.state.parts]
        present, ordered = set(parts), set(self.order)
        self.order = [part for part in self.order if part in present]
        new = [part for part in parts if part not in ordered]
        if new and name == "add_machine":
            letter = list(self.machine.state.structures)[-1]
            source = self._sources[self.machine.state.structures[letter].source]
            new = [f"{letter}_{part}" for part in source.order]
        self.order += new
        is_move = outcome.ok or (isinstance(outcome, Refused) and outcome.cause is Cause.OVERLAP)
        if is_move and name in ("twist_block", "shift_block") and isinstance(arguments, dict):
            moved = str(arguments["block_id"])
            self.order.remove(moved)
            self.order.append(moved)
        return outcome


def _sequences(content: object) -> Iterator[_Sequence]:
    """Return the sequences of a file, which holds several, one, or the steps of one."""
    if isinstance(content, dict):
        yield read(content, _Sequence, where="input", error=SequenceError)
        return
    entries = content if isinstance(content, list) else []
    if entries and all(isinstance(entry, dict) and "steps" in entry for entry in entries):
        for index, entry in enumerate(entries):
            yield read(entry, _Sequence, where=f"input[{index}]", error=SequenceError)
    else:
        steps = read(content, tuple[_Step, ...], where="input", error=SequenceError)
        yield _Sequence(steps=steps)
