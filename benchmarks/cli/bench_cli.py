"""How long commands take, beside `python -c "import typer, httpx"`. Prints medians as JSON.

The bars, as ratios to that: 0.7 for help and completion, 1.8 for commands that only ask the API.
Where the API is asked, its own time is subtracted: the median of the same requests, each over a
connection of its own, sent by this process. All are measured in turns, so that a busy moment of
the machine meets all alike.
"""

import argparse
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import httpx
from benchmarks.figures import tell
from support.servers.api_process import api_process

BUILDARENA = str(Path(sys.executable).parent / "buildarena")
REFERENCE = [sys.executable, "-c", "import typer, httpx"]
SWEEP = {
    "tasks": ["support-1", "lift-1"],
    "models": ["builtin/idle", "builtin/random"],
    "samples": 8,
    "simulator": "mujoco",
}
GOALS = {"help": 0.7, "completion": 0.7, "asking the API": 1.8}
ROUNDS = 11


def main() -> None:
    """Runs the benchmark and prints its figures."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    given = parser.parse_args()
    with api_process() as (url, _):
        figures = measured(url, given.rounds)
    tell(figures, given.json)


def measured(url: str, rounds: int) -> dict[str, Any]:
    """Medians and ratios of all commands."""
    with httpx.Client(base_url=url) as client:
        sweep = client.post("/v1/sweeps", json=SWEEP).raise_for_status().json()["id"]
        client.post(f"/v1/sweeps/{sweep}/cancel").raise_for_status()
        job = client.get("/v1/jobs").json()["jobs"][0]["id"]
    asking = {
        "job list": "/v1/jobs?limit=50",
        f"job show {job}": f"/v1/jobs/{job}",
        "sweep list": "/v1/sweeps?limit=20",
        f"sweep status {sweep}": f"/v1/sweeps/{sweep}",
        "leaderboard": "/v1/leaderboard",
        "task list": "/v1/tasks",
        "model list": "/v1/models",
        "doctor": "/v1/health",
    }
    runs: dict[str, Callable[[], float]] = {
        "reference": lambda: _run(REFERENCE),
        "--help": lambda: _run([BUILDARENA, "--help"]),
        "sweep --help": lambda: _run([BUILDARENA, "sweep", "--help"]),
        "job list --help": lambda: _run([BUILDARENA, "job", "list", "--help"]),
        "complete a command": lambda: _completed("buildarena swe", 1, url),
        "complete a job's id": lambda: _completed("buildarena job show job_", 3, url),
    }
    for words, path in asking.items():
        runs[words] = lambda words=words: _run([BUILDARENA, *words.split(), "--url", url])  # type: ignore[misc]
        runs[path] = lambda path=path: _asked(url, path)  # type: ignore[misc]
    taken = _taken(runs, rounds)
    rows = [_row(name, "help", taken, name) for name in runs if name.endswith("--help")]
    rows.append(_row("complete a command", "completion", taken, "complete a command"))
    word = "complete a job's id"
    rows.append(_row(word, "completion", taken, word, own="/v1/jobs?limit=50"))
    for words, path in asking.items():
        name = words.split(" job_")[0].split(" sweep_")[0]
        rows.append(_row(name, "asking the API", taken, words, own=path))
    return {
        "load_average_before": os.getloadavg()[0],
        "rounds": rounds,
        "reference_s": round(statistics.median(taken["reference"]), 4),
        "goals": GOALS,
        "commands": rows,
        "met": all(row["ratio"] <= GOALS[row["kind"]] for row in rows),
    }


def _taken(runs: Mapping[str, Callable[[], float]], rounds: int) -> dict[str, list[float]]:
    for run in runs.values():  # Once for caches of files and plans.
        run()
    taken: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            taken[name].append(run())
    return taken


def _row(
    name: str, kind: str, taken: Mapping[str, list[float]], run: str, *, own: str | None = None
) -> dict[str, Any]:
    """A command's figures; its ratio is the median of those of the rounds."""
    of_the_api = taken[own] if own else [0.0] * len(taken[run])
    ratios = [
        (seconds - own_s) / reference
        for seconds, own_s, reference in zip(
            taken[run], of_the_api, taken["reference"], strict=True
        )
    ]
    return {
        "command": name,
        "kind": kind,
        "seconds": round(statistics.median(taken[run]), 4),
        "of_the_api_s": round(statistics.median(of_the_api), 4),
        "ratio": round(statistics.median(ratios), 3),
    }


def _run(words: Sequence[str], **environment: str) -> float:
    begun = time.perf_counter()
    subprocess.run(
        words,
        check=False,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **environment},
    )
    return time.perf_counter() - begun


def _completed(line: str, word: int, url: str) -> float:
    return _run(
        [BUILDARENA],
        _BUILDARENA_COMPLETE="complete_bash",
        COMP_WORDS=line,
        COMP_CWORD=str(word),
        BUILDARENA_URL=url,
    )


def _asked(url: str, path: str) -> float:
    with httpx.Client(base_url=url) as client:
        begun = time.perf_counter()
        client.get(path)
        return time.perf_counter() - begun


if __name__ == "__main__":
    main()
