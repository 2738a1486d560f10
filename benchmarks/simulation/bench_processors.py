"""Whether trials give the same bytes on several kinds of processors: `make bench-processors`.

Each kind is a child process. `by default` it differs in what numpy and OpenBLAS would choose, as on
such a processor, and the product pins its kernels all the same: every trajectory must be equal.
`chosen` has the product run the kernels of such a processor (BUILDARENA_BLAS_KERNELS): how many
trajectories differ from those by default, and by how much.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.figures import tell

from buildarena_geometry import kernels

COUNT = 200
ROOT = Path(__file__).parents[2]


def main() -> int:
    """Runs the benchmark.

    Returns:
        The exit code: 1 if a trajectory differs by default.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, help="where the figures go")
    parser.add_argument("--trials", type=int, default=COUNT)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--default-only", action="store_true", help="leave out what is chosen")
    options = parser.parse_args()
    names = kernels.runnable()
    if not names:
        sys.stdout.write("this system does not say what its processor is: nothing is compared\n")
        return 1
    kinds = {f"by default on {name}": as_on(name) for name in names}
    if not options.default_only:
        kinds |= {
            f"chosen {name}": {kernels.CHOICE: name} for name in names if name != kernels.PINNED
        }
    started = time.monotonic()
    with ThreadPoolExecutor(options.processes) as pool:
        runs = list(pool.map(partial(lines, options.trials), kinds.values()))
    first, *others = runs
    figures = {
        "trials": options.trials,
        "seconds": round(time.monotonic() - started),
        "breaking": sum(line["breaks"] > 0 for line in first[1:]),
        "against": {"kind": next(iter(kinds)), **first[0]},
        "kinds": [
            {"kind": kind, **run[0], **compared(first[1:], run[1:])}
            for kind, run in zip(list(kinds)[1:], others, strict=True)
        ],
    }
    tell(figures, options.json)
    default = [kind for kind in figures["kinds"] if kind["kind"].startswith("by default")]
    return 0 if all(kind["equal"] == options.trials for kind in default) else 1


def as_on(name: str) -> dict[str, str]:
    """The variables that have numpy and OpenBLAS choose as on a processor of these kernels."""
    environment = {kernels.CHOICE: name}
    kernels.pin(environment, kernels.runnable())
    del environment[kernels.CHOICE]
    return environment


def lines(count: int, variables: Mapping[str, str]) -> list[dict[str, Any]]:
    """What `processor_trials` prints in a process with these variables besides its own."""
    pinning = {kernels.CHOICE, "OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES"}
    usual = {name: value for name, value in os.environ.items() if name not in pinning}
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.simulation.processor_trials", str(count)],
        env={**usual, "PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "tests"))), **variables},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return [json.loads(line) for line in done.stdout.splitlines()]


def compared(
    first: Sequence[Mapping[str, Any]], second: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """How many trajectories are equal, and how far apart the scores of the others are."""
    pairs = list(zip(first, second, strict=True))
    unequal = [pair for pair in pairs if pair[0]["digest"] != pair[1]["digest"]]
    apart = [
        abs(a["indicator"] - b["indicator"]) / max(abs(a["indicator"]), abs(b["indicator"]), 1e-9)
        for a, b in unequal
        if a["success"] and b["success"]
    ]
    return {
        "equal": len(pairs) - len(unequal),
        "other_verdicts": sum(a["success"] != b["success"] for a, b in unequal),
        "other_breaks": sum(a["breaks"] != b["breaks"] for a, b in unequal),
        "successes_that_differ": len(apart),
        "indicator_apart": {
            "median": statistics.median(apart) if apart else 0.0,
            "within_1_percent": sum(share <= 0.01 for share in apart),
            "largest": max(apart, default=0.0),
        },
    }


if __name__ == "__main__":
    sys.exit(main())
