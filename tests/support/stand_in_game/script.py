"""Runs a machine's Lua script against the mod's functions.

The mod (its source is public) interprets Lua 5.2 and hands out plain tables of functions, called
with a dot; a call with a colon passes the table as the first argument, which these functions refuse
or ignore, as here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, Protocol

from lupa import lua52

from stand_in_game.trial import Part

Point = tuple[float, float, float]

_HIDDEN: Final = ("python", "io", "os", "require", "package", "debug", "dofile", "loadfile")
_HELPERS: Final = """
return function(f)
    return function(...)
        local good, result = f(...)
        if not good then error(result, 2) end
        return result
    end
end
"""
KEY_NAMES: Final = (
    *"abcdefghijklmnopqrstuvwxyz",
    *(f"alpha{digit}" for digit in range(10)),
    *(f"keypad{digit}" for digit in range(10)),
    *(f"f{number}" for number in range(1, 16)),
    *("uparrow", "downarrow", "leftarrow", "rightarrow", "space", "return", "tab", "backspace"),
    *("leftshift", "rightshift", "leftcontrol", "rightcontrol", "leftalt", "rightalt"),
    *("comma", "period", "slash", "semicolon", "quote", "minus", "equals", "home", "end"),
    *("leftbracket", "rightbracket", "backslash", "insert", "delete", "pageup", "pagedown"),
)
"""The keys an emulator can be made for, in lower case: the mod ignores case."""


class World(Protocol):
    """What a script sees and moves."""

    name: str

    def places(self, ref_key: str) -> tuple[int, ...]:
        """The places in the file of the blocks with a reference key."""

    def block_count(self) -> int:
        """How many blocks the machine has."""

    def block(self, place: int) -> Part:
        """A block as it is now."""

    def press(self, key: str, down: bool) -> None:
        """Presses a key or lets it go; its name is in lower case."""

    def slide(self, place: int, slider: str, value: float) -> None:
        """Sets a block's slider."""


class ScriptError(Exception):
    """What the interpreter complains about, in one line."""


class Script:
    """One run of a script: made at the simulation's start, dropped at its end.

    Args:
        text: the script.
        world: what it sees and moves.
        show: takes each printed line.

    Raises:
        ScriptError: it cannot be read, or fails while it is loaded.
    """

    def __init__(self, text: str, world: World, show: Callable[[str], None]) -> None:
        self._world, self._show = world, show
        self._emulators: dict[str, bool] = {}
        self._lua = lua52.LuaRuntime(
            unpack_returned_tuples=True, register_eval=False, register_builtins=False
        )
        self._raising = self._lua.execute(_HELPERS)
        names = self._lua.globals()
        names["print"] = self._function(self._print)
        self._tostring = names["tostring"]
        names["machine"] = self._table(
            new_key_emulator=self._new_key_emulator,
            get_refs_control=self._get_refs_control,
            get_machine_info=self._get_machine_info,
        )
        for name in _HIDDEN:
            names[name] = None
        module = self._guarded(lambda: self._lua.execute(text))
        if lua52.lua_type(module) != "table":
            raise ScriptError("main.lua: the script returns no table of functions")
        self._module = module

    def call(self, name: str) -> None:
        """Calls one of the script's functions; one it does not have is passed over.

        Raises:
            ScriptError: it fails.
        """
        function = self._module[name]
        if function is not None:
            self._guarded(function)

    def _guarded(self, function: Callable[[], Any]) -> Any:
        try:
            return function()
        except lua52.LuaError as error:
            line = " ".join(str(error).split("stack traceback:")[0].split())
            raise ScriptError(line.replace('[string "<python>"]', "main.lua")) from None

    def _function(self, function: Callable[..., Any]) -> Any:
        """A Lua function, to which a fault of the caller is a Lua error."""

        def called(*arguments: Any) -> tuple[bool, Any]:
            try:
                return True, function(*arguments)
            except (TypeError, ValueError, KeyError) as error:
                return False, str(error.args[0] if error.args else error)

        return self._raising(called)

    def _table(self, **functions: Callable[..., Any]) -> Any:
        return self._lua.table_from(
            {name: self._function(function) for name, function in functions.items()}
        )

    def _vector(self, point: Point) -> Any:
        return self._lua.table_from(dict(zip("xyz", point, strict=True)))

    def _print(self, *values: Any) -> None:
        self._show("\t".join(str(self._tostring(value)) for value in values))

    def _new_key_emulator(self, name: Any, *_rest: Any) -> Any:
        key = _text(name, "new_key_emulator").lower()
        if key not in KEY_NAMES:
            raise KeyError(f"the given key was not present in the dictionary: {name}")
        if key in self._emulators:
            raise ValueError("there is already a key emulator with same keycode")
        self._emulators[key] = False

        def turn(down: bool) -> None:
            if self._emulators[key] != down:
                self._emulators[key] = down
                self._world.press(key, down)

        return self._table(
            start=lambda *_: turn(True),
            stop=lambda *_: turn(False),
            active=lambda *_: self._emulators[key],
        )

    def _get_refs_control(self, ref_key: Any, *_rest: Any) -> Any:
        places = self._world.places(_text(ref_key, "get_refs_control"))
        if not places:
            raise ValueError(f"there is no block with key: {ref_key}")

        def set_slider(name: Any, value: Any = None, *_: Any) -> None:
            slider, number = _text(name, "set_slider"), _number(value, "set_slider")
            for place in places:
                self._world.slide(place, slider, number)

        return self._table(set_slider=set_slider)

    def _get_machine_info(self, *_rest: Any) -> Any:
        return self._table(
            get_block_info=self._get_block_info,
            block_count=lambda *_: self._world.block_count(),
            name=lambda *_: self._world.name,
            position=lambda *_: self._vector(self._world.block(0).position),
        )

    def _get_block_info(self, which: Any = None, index: Any = 0, *_rest: Any) -> Any:
        if isinstance(which, str):
            places = self._world.places(which)
            if not places:
                raise ValueError(f"there is no block with reference key {which}")
            if not 0 <= int(index or 0) < len(places):
                raise ValueError(f"there is no block with index {index} with that reference key")
            return self._block_info(places[int(index or 0)])
        if isinstance(which, int | float) and not isinstance(which, bool):
            if not 0 <= int(which) < self._world.block_count():
                raise ValueError(f"build index {int(which)} out of bounds")
            return self._block_info(int(which))
        return None  # as the mod: anything else has no answer

    def _block_info(self, place: int) -> Any:
        world = self._world

        def vector(name: str) -> Callable[..., Any]:
            return lambda *_: self._vector(getattr(world.block(place), name))

        return self._table(
            position=vector("position"),
            forward=vector("forward"),
            right=vector("right"),
            up=vector("up"),
            rotation=lambda *_: self._vector(euler_angles(world.block(place))),
            burning=lambda *_: world.block(place).burning,
            id=lambda *_: world.block(place).type_id,
            build_index=lambda *_: place,
        )


def euler_angles(block: Part) -> Point:
    """Unity's angles of a block, degrees in [0, 360): first about z, then x, then y."""
    right, up, forward = block.right, block.up, block.forward
    x = math.degrees(math.asin(max(-1.0, min(1.0, -forward[1]))))
    y = math.degrees(math.atan2(forward[0], forward[2]))
    z = math.degrees(math.atan2(right[1], up[1]))
    return (x % 360.0, y % 360.0, z % 360.0)


def _text(value: Any, function: str) -> str:
    if not isinstance(value, str):
        raise TypeError(_bad(1, function, "string", value))
    return value


def _number(value: Any, function: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(_bad(2, function, "number", value))
    return float(value)


def _bad(place: int, function: str, wanted: str, value: Any) -> str:
    got = {None: "nil"}.get(value) if value is None else lua52.lua_type(value)
    hint = " (the mod's functions are called with a dot)" if got == "table" else ""
    return f"bad argument #{place} to '{function}' ({wanted} expected, got {got or 'value'}){hint}"
