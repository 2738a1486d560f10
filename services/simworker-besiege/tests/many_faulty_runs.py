"""Faulty runs on several screens at once; prints how they ended, by kind of fault."""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from virtual_screen import virtual_screen

GOOD = ("right", "fault")


def runs_on_a_screen(folder: Path, first: int, runs: int) -> list[dict[str, Any]]:
    """Plays some seeds on a screen of their own; one object per run."""
    words = [sys.executable, "-m", "faulty_runs", str(folder)]
    with virtual_screen() as screen:
        done = subprocess.run(
            [*words, "--first", str(first), "--runs", str(runs)],
            env={**os.environ, **screen},
            stdout=subprocess.PIPE,
            text=True,
            check=False,
        )
    found = [json.loads(line) for line in done.stdout.splitlines() if line.startswith('{"seed"')]
    assert len(found) == runs, done.stdout[-2000:]
    return found


def main() -> None:
    """Plays many runs; exit code 1 if any ended in a wrong score or left something behind."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--screens", type=int, default=2)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    share = -(-given.runs // given.screens)
    firsts = range(given.first, given.first + given.runs, share)
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(given.screens) as pool:
        parts = pool.map(
            lambda first: runs_on_a_screen(
                Path(folder) / str(first), first, min(share, given.first + given.runs - first)
            ),
            firsts,
        )
        every = [run for part in parts for run in part]
    ends = Counter(run["ended"] for run in every)
    by_kind: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for run in every:
        for kind in {fault["fault"] for fault in run["faults"]}:
            by_kind[kind][run["ended"]] += 1
    lines = [f"{len(every)} runs: " + ", ".join(f"{n} {end}" for end, n in ends.most_common())]
    lines += [f"  {kind:18s} {dict(ends)}" for kind, ends in sorted(by_kind.items())]
    lines += [json.dumps(run) for run in every if run["ended"] not in GOOD]
    sys.stdout.write("\n".join(lines) + "\n")
    if given.json is not None:
        given.json.parent.mkdir(parents=True, exist_ok=True)
        given.json.write_text(json.dumps({"ends": ends, "runs": every}, indent=1))
    sys.exit(0 if set(ends) <= set(GOOD) else 1)


if __name__ == "__main__":
    main()
