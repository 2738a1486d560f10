"""The game behind the window: what is loaded, what runs, what the log says."""

import math
import random
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from support.game.stand_in_game.faults import Fault, Faults
from support.game.stand_in_game.golden import UPDATES_PER_S, GameFileError, Run, read_run

GRAVITY: Final = -32.81
SIZE: Final = (1280, 800)
"""The window's width and height, pixels."""
LOAD_S: Final = 0.3
"""How long a machine takes to load, game time."""
_LONGEST_FRAME_S: Final = 0.25
"""A frame that took longer than this makes the game lag instead of jump."""


class Game:
    """The state of the game; the window moves it."""

    def __init__(self, games: Path, faults: Faults, speed: float, level: str) -> None:
        self._games, self.faults, self.speed = games, faults, speed
        self.log, self.level = LogWindow(), Level(level)
        self.machine_name: str | None = None
        self.run: Run | None = None
        self.grounded = self.simulating = False
        self.message = ""
        self._loses_lines = False
        self.time_s, self._update = 0.0, 0

    def load(self, path: Path) -> bool:
        """Loads a machine in place of the present one; whether that worked."""
        try:
            self.run = read_run(path, self._games)
        except GameFileError as error:
            self.message = str(error)
            return False
        self.machine_name, self.message, self.grounded = path.stem, "", False
        return True

    def set_ground(self) -> None:
        """Puts the machine on the floor."""
        self.grounded = self.run is not None

    def delete(self) -> None:
        """Removes the machine."""
        self.machine_name = self.run = None
        self.grounded = False

    def start(self) -> list[Fault]:
        """Starts the simulation; the faults that strike then."""
        self.simulating = True
        struck = self.faults.at("start")
        self._loses_lines = any(fault.kind == "lost_lines" for fault in struck)
        self.time_s, self._update = 0.0, -1
        self.log.clear()
        return struck

    def stop(self) -> None:
        """Ends the simulation; the machine is as it was built."""
        self.simulating = False

    def frame(self, passed_s: float) -> None:
        """One frame of the game."""
        if not self.simulating or self.run is None:
            return
        self.time_s += min(passed_s, _LONGEST_FRAME_S) * self.speed
        printed: list[str] = []
        # All updates that are due come at once, as at a real game's frame.
        while self._update < int(self.time_s * UPDATES_PER_S + 1e-6):
            self._update += 1
            printed += self.run.printed(self._update, self._world())
        self.log.append(printed, loses=self._loses_lines)

    def _world(self) -> str:
        """What the script measures in its first update: gravity, entities, screen, ground."""
        assert self.run is not None
        heights = [self.level.ground(*place) for place in self.run.probes]
        size = (len(self.level.boxes), *SIZE)
        found = [f"{height:.4f}" for height in heights]
        return ",".join([f"w,{GRAVITY:.4f}", *map(str, size), *found])


KEPT: Final = 301
"""Lines that the window keeps: one goes when there are more than 300."""


class LogWindow:
    """What the log window shows."""

    def __init__(self) -> None:
        self._lines: deque[str] = deque(maxlen=KEPT)
        self._draw = random.Random(0)

    def append(self, printed: Sequence[str], *, loses: bool) -> None:
        """Takes the lines printed since the last frame, oldest first; some may be lost."""
        for line in printed:
            if not loses or self._draw.random() > 0.3:
                self._lines.appendleft(line)

    def clear(self) -> None:
        """Empties it, as a new simulation does."""
        self._lines.clear()

    @property
    def count(self) -> int:
        """How many lines there are; without any the window is not drawn."""
        return len(self._lines)

    def text(self) -> str:
        """All its lines."""
        return "\n".join(self._lines)


Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Box:
    """A fixed box: the middle of its underside, its edges' directions, its size."""

    origin: Vector
    axes: tuple[Vector, Vector, Vector]
    size: Vector

    def top(self, east: float, north: float) -> float | None:
        """Where a line from above meets it; None if it misses."""
        low, high = -math.inf, math.inf
        away = (east - self.origin[0], -self.origin[1], north - self.origin[2])
        bounds = [(-self.size[0] / 2, self.size[0] / 2), (0.0, self.size[1])]
        bounds.append((-self.size[2] / 2, self.size[2] / 2))
        for axis, (least, most) in zip(self.axes, bounds, strict=True):
            start = sum(a * b for a, b in zip(axis, away, strict=True))
            if abs(axis[1]) < 1e-9:
                if not least <= start <= most:
                    return None
                continue
            ends = sorted(((least - start) / axis[1], (most - start) / axis[1]))
            low, high = max(low, ends[0]), min(high, ends[1])
        return high if low <= high else None


class Level:
    """What is open: the flat sandbox, or a level file's boxes on its ground."""

    def __init__(self, file: str | None) -> None:
        objects = ET.fromstring(Path(file).read_bytes()).iter("Object") if file else ()
        self.boxes = [_box(entry) for entry in objects if entry.get("Prefab") == "7000"]

    def ground(self, east: float, north: float) -> float:
        """The height at which a ray from above ends."""
        tops = [box.top(east, north) for box in self.boxes]
        return max((top for top in tops if top is not None), default=0.0)


def _box(entry: ET.Element) -> Box:
    turn = entry.find("Rotation")
    x, y, z, w = (float(turn.get(name, 0)) for name in "xyzw") if turn is not None else (0, 0, 0, 1)
    axes = (
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )
    return Box(_vector(entry.find("Position")), axes, _vector(entry.find("Scale")))


def _vector(entry: ET.Element | None) -> Vector:
    assert entry is not None
    x, y, z = (float(entry.get(name, 0)) for name in "xyz")
    return (x, y, z)
