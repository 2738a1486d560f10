"""The service's own time per job: all its processes' processor time beside session and simulation.

Prints its figures as JSON. How it is measured: `benchmarks/api/overhead.py`.
"""

import argparse
import os
from pathlib import Path

from benchmarks.api.overhead import measure_overhead
from benchmarks.figures import tell


def main() -> None:
    """Runs the benchmark and prints its figures."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--jobs", type=int, default=500)
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    given = parser.parse_args()
    figures = {**measure_overhead(given.jobs), "load_average": round(os.getloadavg()[0], 1)}
    tell(figures, given.json)


if __name__ == "__main__":
    main()
