from __future__ import annotations

import math
import random

import pytest

from buildarena_worker.session.results import SessionEnded
from buildarena_worker.session.spending import Spending


def test_a_request_that_did_not_come_in_time_reaches_the_limit_whatever_was_used_before() -> None:
    rng = random.Random(4)
    for _ in range(2000):
        limit = rng.choice([0.1, 1.5, 60, 1e9]) * rng.uniform(0.5, 2)
        spending = Spending({"max_seconds": limit}, seconds=limit * rng.random())
        left = spending.seconds_left
        latency_s = spending.to_the_end(left * rng.choice([1e-9, 0.5, 1.0, 1.01]))
        spending.seconds += latency_s
        assert latency_s <= left * 1.01 + 1e-6 * limit
        with pytest.raises(SessionEnded, match="max_seconds"):
            spending.require_room()


def test_without_a_limit_there_is_always_time(subtests) -> None:
    for limits in [{}, {"max_seconds": None}]:
        with subtests.test(limits=limits):
            spending = Spending(limits, seconds=1e6)
            assert spending.seconds_left == math.inf
            assert spending.to_the_end(2.5) == 2.5
