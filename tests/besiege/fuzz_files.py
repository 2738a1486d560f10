"""Reads, writes and reads again many damaged machine files; `make scenario NAME=besiege`."""

import argparse
import random
import sys
import time
import traceback
from collections import Counter

from support.machine_files import RICH, published_files
from tests.besiege.hostile import mutated, rearranged
from tests.besiege.playing import press, vehicle
from tests.besiege.round_trips import round_trip

from buildarena_benchmark import builtin_tasks
from buildarena_besiege import plain_machine_file, prepare_run

SLOWEST_S = 10.0


def _trial(task: str) -> bytes:
    scenario, presses = builtin_tasks()[task].scenario, [press(1.0, "UpArrow", 1.0)]
    machine = vehicle(cannon=True)
    return prepare_run(machine, scenario, name="m", run_id="r", controls=presses).machine_file


SAMPLES = [
    published_files()["single_5_transport_medium"],
    plain_machine_file(vehicle(cannon=True), name="m", controls=[press(1.0, "UpArrow", 1.0)]),
    _trial("transport-2"),
    _trial("lift-2"),
    RICH,
    RICH,
]
DAMAGES = [mutated, rearranged]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    drawn = random.Random(options.seed)
    ends: Counter[str] = Counter()
    slowest, started = 0.0, time.perf_counter()
    for number in range(options.files):
        which, seed = drawn.randrange(len(SAMPLES)), drawn.getrandbits(32)
        damage = DAMAGES[number % len(DAMAGES)]
        before = time.process_time()
        try:
            ends["whole" if round_trip(damage(SAMPLES[which], seed)) else "refused"] += 1
        except Exception:  # noqa: BLE001  whatever it is, it is what is looked for
            traceback.print_exc()
            print(f"file {which}, {damage.__name__}, seed {seed}")  # noqa: T201  the output
            ends["broken"] += 1
        slowest = max(slowest, time.process_time() - before)
    print(  # noqa: T201  the command's output
        f"{options.files} files in {time.perf_counter() - started:.0f} s: {dict(ends)}; "
        f"slowest {slowest:.2f} s"
    )
    return int(ends["broken"] > 0 or slowest > SLOWEST_S)


if __name__ == "__main__":
    sys.exit(main())
