"""A controller's program: Lua 5.2 from a stranger, within bounds of text, memory and time.

It is the Lua of the game's script mod: numbers are doubles and no more, so that a program answers
alike in our engines and in the game.
"""

import re
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any, Final

from buildarena_geometry.json_values import MAX_CONTROLLER_BYTES
from buildarena_simulation.errors import ControllerFailed

MAX_MEMORY_BYTES: Final = 8 * 1024 * 1024
MAX_INSTRUCTIONS: Final = 100_000
"""Of one tick, and of what stands outside of all functions."""
MAX_INSTRUCTIONS_IN_ALL: Final = 20_000_000
MAX_TICK_S: Final = 0.5
"""Processor time of a tick. Only texts of megabytes take so long within the instructions."""
MAX_TEXTS_S: Final = 10.0
"""Processor time of a trial's ticks together."""
MAX_SENSORS: Final = 100
MAX_ANSWERS: Final = 500
MAX_NAME: Final = 100
"""Bytes of a name in an answer."""

_LINE: Final = re.compile(r"^controller:(\d+): ")
_MOST_WORDS: Final = 300
_PER_CALL: Final = 200  # arguments that Lua takes at once

_BOUNDS: Final = {
    "instructions": f"it took more than {MAX_INSTRUCTIONS:,} instructions",
    "instructions_in_all": f"it took more than {MAX_INSTRUCTIONS_IN_ALL:,} instructions in all",
    "clock": f"it took more than {MAX_TICK_S:g} s of a processor",
    "memory": f"it took more than {MAX_MEMORY_BYTES // 2**20} MiB of memory",
}

_BITS: Final = "&, |, ~, << and >>: write * and / by powers of two"
_NEWER: Final = {
    "'/'": "//: write math.floor(a / b)",
    **dict.fromkeys(("'&'", "'|'", "'~'", "'<'", "'>'"), _BITS),
    r"'\u'": r"\u: write the bytes, as in \195\164",
}
"""What later versions of Lua have, by the token at which 5.2 stumbles, and what to write for it."""
_ATTRIBUTES: Final = "<const> and <close>: write the name alone"

Layout = Mapping[str, "Layout | int"]
"""Names of senses: each a further layout, or which of the numbers it is, from 0."""


@cache
def environment_text() -> bytes:
    """The Lua in which programs run, here and in the scripts of the game."""
    return files(__package__).joinpath("environment.lua").read_bytes()


class Program:
    """A program that was read, with what it keeps in its variables.

    Args:
        text: Lua; it defines ``control(t, sense)``, and may list ``sensors``.
        seed: Of its random numbers.
        most_s: Processor time of a tick, in place of `MAX_TICK_S`.

    Attributes:
        sensors: Ids of the blocks about which it wants to be told, beside the starting block.

    Raises:
        ControllerFailed: It is too long, is no Lua, fails while it is read, or has no ``control``.
    """

    def __init__(self, text: str, *, seed: int = 0, most_s: float = MAX_TICK_S) -> None:
        data = text.encode("utf-8", errors="replace")
        if len(data) > MAX_CONTROLLER_BYTES:
            raise ControllerFailed(
                f"the program has {len(data):,} bytes; at most {MAX_CONTROLLER_BYTES:,} are read"
            )
        self._tick: int | None = None
        self._time_s = 0.0
        self._clock_s = 0.0
        self._driver = self._guarded(lambda: _started(seed, most_s))
        self._take, self._answer = self._driver["take"], self._driver["answer"]
        self._read(data)
        self.sensors = self._listed()

    def senses_are(self, layout: Layout) -> None:
        """Says how the numbers of a tick are named.

        Args:
            layout: The names; the program sees tables of tables.
        """
        source = layout_source(layout).encode("latin-1", "replace")
        self._guarded(lambda: self._driver["senses_are"](source))

    def answer(self, tick: int, time_s: float, values: Sequence[float]) -> dict[str, float]:
        """What the program answers at a tick: names and numbers, as it gave them.

        Args:
            tick: Which tick, from 0.
            time_s: Seconds.
            values: What it senses, in the order of the layout.

        Raises:
            ControllerFailed: It raises, takes too much, or answers what is no table of numbers.
        """
        self._tick, self._time_s = tick, time_s
        flat = self._guarded(lambda: self._asked(time_s, values))
        named = self._require(flat)
        answers = {}
        for name, value in zip(named[::2], named[1::2], strict=True):
            number = float(value)
            if number != number:  # noqa: PLR0124 - not a number is not itself
                raise self._failed(f"what it answers for {_plain(name)} is no number")
            answers[name] = number
        return answers

    def _read(self, data: bytes) -> None:
        try:
            self._require(self._guarded(lambda: self._driver["read"](data)))
        except ControllerFailed as failure:
            newer = _newer_syntax(data, failure)
            if newer is None:
                raise
            raise ControllerFailed(
                f"programs are Lua 5.2, which has no {newer}", line=failure.line
            ) from None

    def _asked(self, time_s: float, values: Sequence[float]) -> Any:
        self._take(*values[:_PER_CALL])
        for first in range(_PER_CALL, len(values), _PER_CALL):
            self._driver["more"](*values[first : first + _PER_CALL])
        return self._answer(time_s, MAX_ANSWERS, MAX_NAME)

    def _listed(self) -> tuple[str, ...]:
        listed = self._guarded(lambda: self._driver["sensors"](MAX_SENSORS))
        ids = listed if isinstance(listed, tuple) else (listed,)
        if None in ids:
            raise self._failed("sensors is no list of block ids")
        if len(ids) > MAX_SENSORS:
            raise self._failed(f"sensors has more than {MAX_SENSORS} block ids")
        return tuple(block for block in ids if block)

    def _guarded(self, call: Any) -> Any:
        """What a call gives; whatever goes wrong inside of Lua is the program's failure."""
        from lupa.lua52 import LuaError

        try:
            return call()
        except MemoryError:
            raise self._failed(_BOUNDS["memory"]) from None
        except LuaError as error:
            raise self._failed(str(error)) from None

    def _require(self, result: Any) -> tuple[Any, ...]:
        """What follows the word that all went well.

        Raises:
            ControllerFailed: It did not.
        """
        ok, *further = result if isinstance(result, tuple) else (result,)
        if ok:
            return tuple(further)
        why, message = further[0], further[1] if len(further) > 1 else ""
        raise self._failed(_BOUNDS.get(why) or message)

    def _failed(self, message: str) -> ControllerFailed:
        if "not enough memory" in message:
            message = _BOUNDS["memory"]
        line = _LINE.match(message)
        words = _plain(message[line.end() if line else 0 :])
        return ControllerFailed(
            words, line=int(line[1]) if line else None, tick=self._tick, time_s=self._time_s
        )


def blames_clock(sentence: str) -> bool:
    """Whether a program is said to have failed by a processor's time, which differs everywhere."""
    return _BOUNDS["clock"] in sentence


def _started(seed: int, most_s: float) -> Any:
    from lupa.lua52 import LuaRuntime

    runtime: LuaRuntime = LuaRuntime(
        unpack_returned_tuples=True,
        register_eval=False,
        register_builtins=False,
        encoding="latin-1",
        max_memory=MAX_MEMORY_BYTES,
    )
    return runtime.execute(
        environment_text(), seed, MAX_INSTRUCTIONS, MAX_INSTRUCTIONS_IN_ALL, most_s, MAX_TEXTS_S
    )


def _newer_syntax(data: bytes, failure: ControllerFailed) -> str | None:
    """What a text that 5.2 refuses has of later versions; None where those refuse it too."""
    from lupa.lua54 import LuaError, LuaRuntime

    near = next((what for token, what in _NEWER.items() if f"near {token}" in str(failure)), None)
    if near is None or failure.line is None:
        return None
    runtime: LuaRuntime = LuaRuntime(
        register_eval=False,
        register_builtins=False,
        encoding="latin-1",
        max_memory=MAX_MEMORY_BYTES,
    )
    try:
        compiled = runtime.compile(data)  # and never run
    except (LuaError, MemoryError):
        return None
    del compiled
    lines = data.splitlines()
    line = lines[failure.line - 1] if failure.line <= len(lines) else b""
    return _ATTRIBUTES if re.search(rb"<\s*(const|close)\s*>", line) else near


def layout_source(layout: Layout) -> str:
    """Lua that gives a function from the list of a tick's numbers to the program's tables."""
    return f"return function(v) return {_constructor(layout)} end"


def _constructor(layout: Layout) -> str:
    entries = []
    for name, what in layout.items():
        value = f"v[{what + 1}]" if isinstance(what, int) else _constructor(what)
        entries.append(f"[{_quoted(name)}]={value}")
    return "{" + ",".join(entries) + "}"


def _quoted(name: str) -> str:
    return '"' + "".join(f"\\{byte:03d}" for byte in name.encode()) + '"'


def _plain(text: str) -> str:
    """A stranger's words in one line of bounded length."""
    shown = "".join(c if c.isprintable() else "?" for c in text[:_MOST_WORDS])
    return shown + "…" if len(text) > _MOST_WORDS else shown
