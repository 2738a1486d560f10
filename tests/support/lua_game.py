"""A game that runs a script of ours in a real Lua: the mod's functions, blocks on given paths."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from buildarena_besiege.exporting.machine_file import BlockRecord
from buildarena_geometry.rotations import rotate

Path = Callable[[int, int], tuple[float, float, float]]
"""Where block number i of the file is after n updates, Besiege's components."""

Turn = Callable[[int, int], tuple[float, float, float, float]]
"""How that block is turned, (w, x, y, z) in Besiege's components."""

Ground = Callable[[float, float], float | str | None]
"""The ground's height at a place east and north; "b" where a block is in the way, None for none."""

VERSIONS = ("lua51", "lua52", "lua53", "lua54", "lua55", "luajit21")


def as_built(_i: int, _n: int) -> tuple[float, float, float, float]:
    return (1.0, 0.0, 0.0, 0.0)


def golden_path(i: int, n: int) -> tuple[float, float, float]:
    height = 1 + 0.25 * i + 0.0021 * n + 0.004
    return (0.5 * i + 0.0137 * n + 0.003, height, -0.75 * i - 0.0053 * n + 0.002)


def flat_ground(_east: float, _north: float) -> float:
    return 0.0


def golden_burning(i: int, n: int) -> bool:
    return n >= 500 and i % 2 == 1


def references_of(records: Sequence[BlockRecord]) -> dict[object, int]:
    """The numbers of a file's blocks by what the script calls them."""
    references: dict[object, int] = {r.reference_key: i for i, r in enumerate(records)}
    references[0] = references.pop(records[0].reference_key)
    return references


@dataclass
class LuaGame:
    """Plays a script; what it did stands in the attributes.

    Arguments of the mod's functions are checked as the mod does: they are called with a dot.
    """

    references: dict[object, int]
    version: str = "lua54"
    path: Path = golden_path
    turn: Turn = as_built
    burning: Callable[[int, int], bool] = golden_burning
    destroyed: Callable[[int, int], bool] = lambda _i, _n: False
    ground: Ground = flat_ground
    gravity: float = -32.81
    screen: tuple[int, int] = (1280, 800)
    updates: int = 0
    lines: list[str] = field(default_factory=list)
    calls: dict[str, list[tuple[int, bool]]] = field(default_factory=dict)
    slider: list[tuple[int, str, float]] = field(default_factory=list)

    def play(self, script: str, updates: int) -> LuaGame:
        runtime = importlib.import_module(f"lupa.{self.version}").LuaRuntime(
            unpack_returned_tuples=True, register_eval=False, register_builtins=False
        )
        globals_ = runtime.globals()
        globals_["print"] = self.lines.append
        globals_["machine"] = runtime.table_from(
            {
                "new_key_emulator": lambda key: self._emulator(runtime, key),
                "get_refs_control": lambda key: self._control(runtime, key),
                "get_machine_info": lambda: runtime.table_from(
                    {"get_block_info": lambda key: self._info(runtime, key)}
                ),
            }
        )
        globals_["physics"] = runtime.table_from(
            {
                "gravity": lambda: self._vector(runtime, (0.0, self.gravity, 0.0)),
                "raycast": lambda start, along: self._hit(runtime, start, along),
            }
        )
        globals_["screen"] = runtime.table_from(
            {"width": lambda: float(self.screen[0]), "height": lambda: float(self.screen[1])}
        )
        globals_["entities"] = runtime.table_from({"count": lambda: 0.0})
        module = runtime.execute(script)
        assert set(module) == {"play", "update", "late_update", "fixed_update", "on_gui"}
        module["play"]()
        for n in range(1, updates + 1):
            self.updates = n
            module["fixed_update"]()
        for name in ("update", "late_update", "on_gui"):
            module[name]()
        return self

    def held(self, key: str) -> list[list[int | None]]:
        """When a key was down: first update, and the one in which it was let go."""
        state: dict[int, bool] = dict(self.calls.get(key, []))
        spans: list[list[int | None]] = []
        down = False
        for n, now in sorted(state.items()):
            if now and not down:
                spans.append([n, None])
            elif down and not now:
                spans[-1][1] = n
            down = now
        return spans

    def _emulator(self, runtime, key):
        assert isinstance(key, str)
        assert key not in self.calls, "the mod refuses a second emulator of a key"
        self.calls[key] = []
        return runtime.table_from(
            {
                "start": lambda: self.calls[key].append((self.updates, True)),
                "stop": lambda: self.calls[key].append((self.updates, False)),
            }
        )

    def _control(self, runtime, key):
        self.references[key]
        return runtime.table_from(
            {"set_slider": lambda name, v: self.slider.append((self.updates, name, v))}
        )

    def _info(self, runtime, key):
        number = self.references[key]

        def position():
            assert not self.destroyed(number, self.updates), "the game has no such block any more"
            return self._vector(runtime, self.path(number, self.updates))

        def axis(own):
            def told():
                assert not self.destroyed(number, self.updates)
                turn = self.turn(number, self.updates)
                size = math.sqrt(sum(part * part for part in turn))
                w, x, y, z = (part / size for part in turn)
                return self._vector(runtime, rotate((w, x, y, z), own))

            return told

        return runtime.table_from(
            {
                "right": axis((1.0, 0.0, 0.0)),
                "up": axis((0.0, 1.0, 0.0)),
                "forward": axis((0.0, 0.0, 1.0)),
                "position": position,
                "burning": lambda: self.burning(number, self.updates),
                "destroyed": lambda: self.destroyed(number, self.updates),
            }
        )

    def _hit(self, runtime, start, along):
        # The mod takes four components of every vector.
        assert all(isinstance(one[axis], int | float) for one in (start, along) for axis in "xyzw")
        assert (along["x"], along["y"], along["z"]) == (0, -1, 0)
        height = self.ground(start["x"], start["z"])
        if height is None:
            return None
        high = 3.0 if height == "b" else float(height)
        point = self._vector(runtime, (start["x"], high, start["z"]))
        return runtime.table_from({"point": point, "is_block": height == "b"})

    @staticmethod
    def _vector(runtime, components):
        return runtime.table_from(dict(zip("xyz", components, strict=True)) | {"w": 0.0})
