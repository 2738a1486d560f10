"""Controller programs: untrusted Lua 5.2 with limits on text, memory and time.

The game's script mod has the same Lua, whose only numbers are doubles, so a program gives the same
answers in the engines and in the game.
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
"""Limit for one tick, and for the code outside functions."""
MAX_INSTRUCTIONS_IN_ALL: Final = 20_000_000
MAX_TICK_S: Final = 0.5
"""Maximum processor time of a tick. Only texts of megabytes reach it."""
MAX_TEXTS_S: Final = 10.0
"""Maximum processor time of all ticks of a trial."""
MAX_SENSORS: Final = 100
MAX_ANSWERS: Final = 500
MAX_NAME: Final = 100
"""Maximum length of a name in an answer, bytes."""

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
"""Syntax of later versions of Lua, by the token that 5.2 rejects, and its replacement."""
_ATTRIBUTES: Final = "<const> and <close>: write the name alone"

Layout = Mapping[str, "Layout | int"]
"""Names of senses: each a nested layout, or the index of its number, from 0."""


@cache
def environment_text() -> bytes:
    """Return the Lua environment in which programs run, here and in the scripts of the game."""
    return files(__package__).joinpath("environment.lua").read_bytes()


class Program:
    """A loaded program, with the state of its variables.

    Args:
        text: Lua; it defines ``control(t, sense)``, and may list ``sensors``.
        seed: Seed of its random numbers.
        most_s: Processor time of a tick, in place of `MAX_TICK_S`.

    Attributes:
        sensors: Ids of the blocks whose senses it requests, besides the starting block.

    Raises:
        ControllerFailed: It is too long, is not Lua, fails while it is loaded, or has no
            ``control``.
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
        """Set the names of the numbers of a tick.

        Args:
            layout: The names; the program sees tables of tables.
        """
        source = layout_source(layout).encode("latin-1", "replace")
        self._guarded(lambda: self._driver["senses_are"](source))

    def answer(self, tick: int, time_s: float, values: Sequence[float]) -> dict[str, float]:
        """Run the program at a tick, and return its answers: names and numbers, unmodified.

        Args:
            tick: Number of the tick, from 0.
            time_s: Seconds.
            values: Senses, in the order of the layout.

        Raises:
            ControllerFailed: It raises, exceeds a limit, or does not answer a table of numbers.
        """
        self._tick, self._time_s = tick, time_s
        flat = self._guarded(lambda: self._call_control(time_s, values))
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

    def _call_control(self, time_s: float, values: Sequence[float]) -> Any:
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
        """Return the result of a call; any error inside Lua is the program's failure."""
        from lupa.lua52 import LuaError

        try:
            return call()
        except MemoryError:
            raise self._failed(_BOUNDS["memory"]) from None
        except LuaError as error:
            raise self._failed(str(error)) from None

    def _require(self, result: Any) -> tuple[Any, ...]:
        """Return the values after the status of a call.

        Raises:
            ControllerFailed: The status is an error.
        """
        ok, *values = result if isinstance(result, tuple) else (result,)
        if ok:
            return tuple(values)
        cause, message = values[0], values[1] if len(values) > 1 else ""
        raise self._failed(_BOUNDS.get(cause) or message)

    def _failed(self, message: str) -> ControllerFailed:
        if "not enough memory" in message:
            message = _BOUNDS["memory"]
        line = _LINE.match(message)
        text = _plain(message[line.end() if line else 0 :])
        return ControllerFailed(
            text, line=int(line[1]) if line else None, tick=self._tick, time_s=self._time_s
        )


def blames_clock(sentence: str) -> bool:
    """Check if a failure depends on processor time, which differs between machines."""
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
    """Return syntax of later Lua versions in a text that 5.2 refuses; None if there is none."""
    from lupa.lua54 import LuaError, LuaRuntime

    syntax = next((name for token, name in _NEWER.items() if f"near {token}" in str(failure)), None)
    if syntax is None or failure.line is None:
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
    return _ATTRIBUTES if re.search(rb"<\s*(const|close)\s*>", line) else syntax


def layout_source(layout: Layout) -> str:
    """Return Lua for a function from a tick's list of numbers to the program's tables."""
    return f"return function(v) return {_constructor(layout)} end"


def _constructor(layout: Layout) -> str:
    entries = []
    for name, item in layout.items():
        value = f"v[{item + 1}]" if isinstance(item, int) else _constructor(item)
        entries.append(f"[{_quoted(name)}]={value}")
    return "{" + ",".join(entries) + "}"


def _quoted(name: str) -> str:
    return '"' + "".join(f"\\{byte:03d}" for byte in name.encode()) + '"'


def _plain(text: str) -> str:
    """Return untrusted text in one line of bounded length."""
    shown = "".join(c if c.isprintable() else "?" for c in text[:_MOST_WORDS])
    return shown + "…" if len(text) > _MOST_WORDS else shown
