"""The service's own time per job: all its processes' processor time beside session and simulation.

Prints its figures as JSON. How it is measured: `benchmarks/api/overhead.py`.
"""

import argparse
import json
import os
import sys
from pathlib import Path

from benchmarks.api.overhead import measure_overhead


def main() -> None:
    """Runs the benchmark and prints its figures."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--jobs", type=int, default=500)
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    given = parser.parse_args()
    figures = {**measure_overhead(given.jobs), "load_average": round(os.getloadavg()[0], 1)}
    text = json.dumps(figures, indent=2) + "\n"
    sys.stdout.write(text)
    if given.json is not None:
        given.json.parent.mkdir(parents=True, exist_ok=True)
        given.json.write_text(text)


if __name__ == "__main__":
    main()
