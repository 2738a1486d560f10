"""The attack: everything an adversary tries, at full size, and what an innocent caller noticed.

`python -m scenarios.attack.run [SCENARIO ...]` prints a table; it ends with 1 when something is
wrong.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from scenarios.attack.arena import Arena, Tried, arena
from scenarios.attack.scenarios import SCENARIOS

FULL: Mapping[str, float] = {
    "jobs": 1000,
    "streams": 800,
    "exports": 200,
    "boards": 400,
    "verifications": 1500,
    "half requests": 20_000,
    "flood_s": 10,
    "bomb_mib": 2048,
    "lies": 100,
    "heartbeats": 100,
    "kills": 10,
    "strangers": 200,
    "broker_s": 60,
}
P99_BOUND_S = 0.25
QUIET = frozenset({"streams", "verifications"})
"""Floods beside which an innocent caller's 99th percentile has a bar."""
MAX_MIB = 400
DISK_MIB = 64


@contextmanager
def small_disk(place: Path, mebibytes: int = DISK_MIB) -> Iterator[Path]:
    """A folder on a small disk of its own, where that may be made; else a usual folder."""
    place.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", f"size={mebibytes}m", "tmpfs", str(place)]
    mounted = os.geteuid() == 0 and subprocess.run(words, check=False).returncode == 0
    try:
        yield place
    finally:
        if mounted:
            subprocess.run(["umount", "-l", str(place)], check=True)


def attack(found: Arena, name: str) -> dict[str, object]:
    """Runs a scenario; what came of it, as a row."""
    found.victim.take()
    started = time.monotonic()
    try:
        tried = SCENARIOS[name](found)
    except AssertionError as error:
        tried = Tried(name, wrong=[str(error)])
    high, asked, failed = found.victim.take()
    memory = found.memory()
    tried.require(failed == 0, f"{failed} of an innocent caller's requests failed")
    if name in QUIET:
        tried.require(high <= P99_BOUND_S, f"innocent p99 {high * 1000:.0f} ms")
    large = {process: size for process, size in memory.items() if size > MAX_MIB}
    tried.require(not large, f"memory {large}")
    return {
        "scenario": name,
        "tried": tried.tried,
        "came_of_it": tried.refused,
        "innocent_p99_ms": round(high * 1000),
        "innocent_requests": asked,
        "seconds": round(time.monotonic() - started, 1),
        "memory_mib": {process: round(size) for process, size in memory.items()},
        "wrong": tried.wrong,
    }


def main() -> int:
    """Attacks; 0 when nothing is wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", nargs="*", choices=[*SCENARIOS, []], default=[])
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    rows = []
    with (
        tempfile.TemporaryDirectory(prefix="buildarena-attack-") as name,
        small_disk(Path(name) / "disk") as disk,
        arena(Path(name), FULL, artifacts_url=str(disk)) as found,
    ):
        for scenario in given.scenario or SCENARIOS:
            row = attack(found, scenario)
            rows.append(row)
            _tell(row)
    if given.json:
        given.json.parent.mkdir(parents=True, exist_ok=True)
        given.json.write_text(json.dumps(rows, indent=1))
    wrong = sum(bool(row["wrong"]) for row in rows)
    sys.stdout.write(f"{len(rows)} scenarios, {wrong} with something wrong\n")
    return int(bool(wrong))


def _tell(row: Mapping[str, object]) -> None:
    memory = row["memory_mib"]
    assert isinstance(memory, dict)
    sizes = ", ".join(f"{name} {size}" for name, size in memory.items())
    sys.stdout.write(
        f"{'!!' if row['wrong'] else 'ok'}  {row['scenario']}: {row['tried']}\n"
        f"      {row['came_of_it']}\n"
        f"      innocent p99 {row['innocent_p99_ms']} ms of {row['innocent_requests']}; "
        f"{row['seconds']} s; MiB: {sizes}\n"
    )
    for wrong in row["wrong"]:  # type: ignore[attr-defined]
        sys.stdout.write(f"      wrong: {wrong}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
