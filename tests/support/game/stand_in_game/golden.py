"""What is known of the runs that the stand-in can play: golden logs, found by the run's script.

A golden log has each line once, without the run's mark in front and the check sum behind.
"""

import re
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

UPDATES_PER_S: Final = 100
BEGIN_EVERY: Final = 50
END_EVERY: Final = 25
"""Updates after which the script prints its begin line, or its end line, once more."""
EARLY: Final = 60
AGAIN: Final = (100, 200)
MAX_EARLY: Final = 150
"""Updates whose lines are printed again, those in which they are, and how many lines at most."""

_TEXT: Final = 'local {} = "([^"]*)"'


class GameFileError(ValueError):
    """A file that the game does not load; the message says why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A run that is known.

    Attributes:
        mark: what every line of this run begins with.
        lines: by update, what is printed then.
        last: the run's last update; its end is told again and again from then on.
        probes: where the script measures the ground, east and north.
    """

    mark: str
    lines: dict[int, list[str]]
    last: int
    probes: tuple[tuple[float, float], ...] = ()

    def printed(self, update: int, world: str) -> list[str]:
        """What the script prints at an update.

        Args:
            update: The script's update.
            world: What it measured of the level.
        """
        lines = self._once(update, world)
        if update in AGAIN and update <= self.last:
            early = [line for at in range(EARLY + 1) for line in self._once(at, world)]
            lines += early[:MAX_EARLY]
        return [self._whole(line) for line in lines]

    def _once(self, update: int, world: str) -> list[str]:
        lines = [] if update == 0 else list(self.lines.get(update, []))
        if update == 1 or (update and update % BEGIN_EVERY == 0 and update <= self.last):
            lines = [*self.lines[0], world, *lines]
        if update > self.last and (update - self.last) % END_EVERY == 0:
            lines = [f"e,{self.last}"]
        return lines

    def _whole(self, line: str) -> str:
        text, total = f"{self.mark},{line}", 0
        for byte in text.encode():
            total = (total * 257 + byte + 1) % 2_147_483_647
        return f"{text},{total}"


def read_run(path: Path, games: Path) -> Run:
    """The run of a machine file."""
    try:
        root = ET.fromstring(path.read_bytes())
    except (OSError, ET.ParseError) as error:
        raise GameFileError(f"could not load {path.stem}: {error}") from error
    script = next((e.text for e in root.iter() if e.text and "local prefix" in e.text), "")
    mark, begin = _text(script, "prefix"), _text(script, "begin")
    with zipfile.ZipFile(games) as archive:
        for name in archive.namelist():
            first, *rest = archive.read(name).decode().splitlines()
            if first == f"b,{begin}":
                return _run(mark, [first, *rest], _probes(script))
    raise GameFileError(f"no game was recorded of {path.stem}, whose log begins with {begin!r}")


def _run(mark: str, lines: list[str], probes: tuple[tuple[float, float], ...]) -> Run:
    by_update: dict[int, list[str]] = {}
    for line in lines:
        kind, update, *_ = line.split(",")
        if kind == "w":  # of the level in which it was recorded
            continue
        by_update.setdefault(0 if kind == "b" else int(update), []).append(line)
    return Run(mark=mark, lines=by_update, last=max(by_update), probes=probes)


def _probes(script: str) -> tuple[tuple[float, float], ...]:
    block = re.search(r"local probes = \{(.*?)\n\}", script, re.DOTALL)
    rows = re.findall(r"\{([-0-9.e]+), ([-0-9.e]+)\}", block[1]) if block else []
    return tuple((float(east), float(north)) for east, north in rows)


def _text(script: str, name: str) -> str:
    found = re.search(_TEXT.format(name), script)
    if found is None:
        raise GameFileError("the machine has no script that reports a run")
    return re.sub(r"\\([0-9]{3})", lambda code: chr(int(code[1])), found[1])
