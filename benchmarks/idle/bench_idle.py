"""What each process of a service costs while there is nothing to do, and what it costs to start.

A whole service without a job stands idle for a minute. The supervisor is the process of this
program, which does nothing else meanwhile.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.figures import tell
from benchmarks.sizing.costs import cpu_s
from support.servers.stacks import running_stack

from buildarena_cli.local.stack import Stack

IDLE_S = 60.0
SETTLING_S = 200.0
"""The supervisor of a service that was just started measures more often."""
MAX_IDLE_PERCENT = 0.5
MAX_START_S = 1.5
WORKERS = ("construct worker", "mujoco worker", "pybullet worker")


def main() -> None:
    """Measures and prints JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    with (
        tempfile.TemporaryDirectory(prefix="buildarena-idle-") as name,
        running_stack(Path(name)) as stack,
    ):
        tell(measure(stack), given.json)


def measure(stack: Stack) -> dict[str, Any]:
    """Percent of a processor of each process, and processor seconds that workers took to start."""
    pids = {
        managed.name: managed.process.pid
        for managed in stack.supervisor.managed
        if managed.process is not None
    }
    started = {name: round(cpu_s(pids[name]), 2) for name in WORKERS if name in pids}
    time.sleep(SETTLING_S)
    before, own = {name: cpu_s(pid) for name, pid in pids.items()}, time.process_time()
    time.sleep(IDLE_S)
    spent = {name: cpu_s(pid) - before[name] for name, pid in pids.items()}
    spent["supervisor"] = time.process_time() - own
    idle = {name: round(100 * seconds / IDLE_S, 2) for name, seconds in spent.items()}
    return {
        "idle_percent": idle,
        "to_start_cpu_s": started,
        "of_the_bar": {
            **{name: round(value / MAX_IDLE_PERCENT, 2) for name, value in idle.items()},
            **{f"{name}, start": round(s / MAX_START_S, 2) for name, s in started.items()},
        },
        "load_average": [round(value, 1) for value in os.getloadavg()],
    }


if __name__ == "__main__":
    main()
