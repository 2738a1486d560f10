"""Memory of processes over hours: the most, and whether it grows beyond its own noise."""

import statistics
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Self

import psutil

from buildarena_benchmark.environment.trials.processes import memory_bytes

MEBI = 1 << 20
NOISES = 3.0
"""Growth is more than noise when it is larger than so many standard deviations around its line."""
SMALLEST = 4.0
"""MiB of growth that are noise in any case: a connection more or less."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Growth:
    """A process' memory.

    Attributes:
        peak_mib: The most that it ever had.
        growth_mib: What the line through the second half of its samples gains over that half.
        noise_mib: How much gain is noise.
        minutes: How long the second half was.
    """

    peak_mib: float
    growth_mib: float
    noise_mib: float
    minutes: float

    @property
    def grows(self) -> bool:
        """Whether it gains more than its noise."""
        return self.growth_mib > self.noise_mib


def growth(samples: list[tuple[float, float]]) -> Growth:
    """What samples of time (seconds) and memory (MiB) say; at least three in the second half."""
    middle = (samples[0][0] + samples[-1][0]) / 2
    half = [sample for sample in samples if sample[0] >= middle]
    times, values = zip(*half, strict=True)
    line = statistics.linear_regression(times, values)
    around = [value - line.slope * at - line.intercept for at, value in half]
    seconds = times[-1] - times[0]
    return Growth(
        peak_mib=max(value for _, value in samples),
        growth_mib=line.slope * seconds,
        noise_mib=max(SMALLEST, NOISES * statistics.pstdev(around)),
        minutes=seconds / 60,
    )


class Watch:
    """Samples the memory of named processes from a thread; use as a context manager.

    Args:
        find: The processes now, by name; each name is one process for its whole life.
        every_s: Seconds between samples.

    Attributes:
        samples: Time and MiB by name.
    """

    def __init__(self, find: Callable[[], Mapping[str, psutil.Process]], *, every_s: float) -> None:
        self.samples: dict[str, list[tuple[float, float]]] = defaultdict(list)
        self._find, self._every_s = find, every_s
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._sample_all, name="memory")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def _sample_all(self) -> None:
        while not self._stop.wait(self._every_s):
            now = time.monotonic()
            for name, process in self._find().items():
                size = memory_bytes(process)
                if size:
                    self.samples[name].append((now, size / MEBI))
