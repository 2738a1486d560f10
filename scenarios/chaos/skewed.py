"""Runs a worker whose clock is wrong: ``python skewed.py HOURS MODULE [ARGUMENT ...]``."""

import runpy
import sys
from datetime import UTC, datetime, timedelta

import time_machine


def main() -> None:
    """Runs the module by the wrong clock."""
    hours, module = float(sys.argv[1]), sys.argv[2]
    sys.argv = sys.argv[2:]
    time_machine.travel(datetime.now(UTC) + timedelta(hours=hours), tick=True).start()
    runpy.run_module(module, run_name="__main__")


# A worker's own processes load this file again.
if __name__ == "__main__":
    main()
