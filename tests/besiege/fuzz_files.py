"""Reads many damaged machine files; `make fuzz-besiege`."""

import argparse
import random
import sys
import time
import traceback
from collections import Counter

from tests.besiege.hostile import mutated
from tests.besiege.test_hostile_files import SAMPLES, refused_or_sound

SLOWEST_S = 10.0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    drawn = random.Random(options.seed)
    ends: Counter[str] = Counter()
    slowest, started = 0.0, time.perf_counter()
    for _ in range(options.files):
        which, seed = drawn.randrange(len(SAMPLES)), drawn.getrandbits(32)
        before = time.process_time()
        try:
            ends["sound" if refused_or_sound(mutated(SAMPLES[which], seed)) else "refused"] += 1
        except Exception:  # noqa: BLE001  whatever it is, it is what is looked for
            traceback.print_exc()
            print(f"file {which}, seed {seed}")  # noqa: T201  the command's output
            ends["broken"] += 1
        slowest = max(slowest, time.process_time() - before)
    print(  # noqa: T201  the command's output
        f"{options.files} files in {time.perf_counter() - started:.0f} s: {dict(ends)}; "
        f"slowest {slowest:.2f} s"
    )
    return int(ends["broken"] > 0 or slowest > SLOWEST_S)


if __name__ == "__main__":
    sys.exit(main())
