from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, binomtest

from buildarena_benchmark.statistics import (
    detectable_difference,
    difference_interval,
    pass_at_k,
    pass_hat_k,
    trials_needed,
    wilson_interval,
)

counts = st.integers(1, 300).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))


@given(counts)
def test_the_wilson_interval_is_scipys(count) -> None:
    theirs = binomtest(*count).proportion_ci(method="wilson")
    assert wilson_interval(*count) == pytest.approx((theirs.low, theirs.high), abs=1e-9)


def test_the_wilson_interval_of_a_hand_worked_case() -> None:
    # 32 of 64: centre 1/2, half width z / (2 sqrt(n + z²))
    half = 1.959964 / (2 * (64 + 1.959964**2) ** 0.5)
    assert wilson_interval(32, 64) == pytest.approx((0.5 - half, 0.5 + half), abs=1e-6)


@given(counts)
def test_the_interval_holds_the_rate_and_mirrors_with_it(count) -> None:
    successes, trials = count
    low, high = wilson_interval(successes, trials)
    assert 0 <= low <= successes / trials <= high <= 1
    mirrored = wilson_interval(trials - successes, trials)
    assert mirrored == pytest.approx((1 - high, 1 - low))


@given(counts)
def test_one_more_success_raises_the_interval(count) -> None:
    successes, trials = count
    if successes < trials:
        low, high = wilson_interval(successes, trials)
        more_low, more_high = wilson_interval(successes + 1, trials)
        assert more_low > low
        assert more_high >= high


def test_impossible_counts_are_refused(subtests) -> None:
    for count in [(0, 0), (3, 2), (-1, 2)]:
        with subtests.test(count=count), pytest.raises(ValueError, match="have no interval"):
            wilson_interval(*count)


def test_the_wilson_interval_covers_as_often_as_it_says() -> None:
    # Its coverage swings with the rate; over the rates of a benchmark it is the nominal one.
    rates = np.linspace(0.02, 0.98, 193)
    covered = np.zeros_like(rates)
    for successes in range(65):
        low, high = wilson_interval(successes, 64)
        covered += np.where((low <= rates) & (rates <= high), binom.pmf(successes, 64, rates), 0)
    assert covered.mean() == pytest.approx(0.95, abs=0.02)


def test_the_interval_of_a_difference_is_newcombes_own_example() -> None:
    # Newcombe 1998, table II, case (a): 56/70 - 48/80, method 10.
    assert difference_interval((56, 70), (48, 80)) == pytest.approx((0.0524, 0.3339), abs=5e-5)


def test_the_interval_of_a_difference_covers_as_often_as_it_says() -> None:
    rng = np.random.default_rng(1)
    hits = []
    for rate_1, rate_2 in ((0.1, 0.3), (0.5, 0.5), (0.8, 0.6), (0.2, 0.05)):
        draws = rng.binomial(64, (rate_1, rate_2), size=(1500, 2))
        for a, b in draws:
            low, high = difference_interval((int(a), 64), (int(b), 64))
            hits.append(low <= rate_1 - rate_2 <= high)
    assert np.mean(hits) == pytest.approx(0.95, abs=0.02)


@given(st.integers(1, 9).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))), st.data())
def test_pass_at_k_and_pass_hat_k_count_subsets(count, data) -> None:
    successes, trials = count
    k = data.draw(st.integers(1, trials))
    outcomes = [True] * successes + [False] * (trials - successes)
    subsets = list(combinations(outcomes, k))
    assert pass_at_k(outcomes, k) == pytest.approx(sum(any(s) for s in subsets) / len(subsets))
    assert pass_hat_k(outcomes, k) == pytest.approx(sum(all(s) for s in subsets) / len(subsets))


@given(st.lists(st.sampled_from([0.0, 0.25, 1 / 3, 0.5, 0.75, 1.0]), min_size=1), st.data())
def test_shares_of_worlds_are_chances_of_one_try(shares, data) -> None:
    shares = shares[:9]
    k = data.draw(st.integers(1, len(shares)))
    subsets = [np.array(subset) for subset in combinations(shares, k)]
    assert pass_at_k(shares, k) == pytest.approx(np.mean([1 - np.prod(1 - s) for s in subsets]))
    assert pass_hat_k(shares, k) == pytest.approx(np.mean([np.prod(s) for s in subsets]))


def test_many_shares_stay_in_range() -> None:
    shares = np.repeat([0.0, 0.25, 0.5, 0.75, 1.0], 20_000)
    for k in (1, 8):
        assert pass_hat_k(shares, k) == pytest.approx(0.5**k, rel=1e-3)
        assert pass_at_k(shares, k) == pytest.approx(1 - 0.5**k, rel=1e-3)


def test_more_tries_than_trials_say_nothing() -> None:
    assert pass_at_k([1, 0, 0], 4) is None
    assert pass_hat_k([1, 0, 0], 4) is None
    assert pass_at_k(np.zeros(64), 8) == 0.0


def test_64_samples_show_a_rise_from_10_to_29_percent_but_not_to_20() -> None:
    rise = detectable_difference(0.1, 64)
    assert rise == pytest.approx(0.19, abs=0.02)
    assert trials_needed(0.1, 0.1 + rise + 1e-9) == 64
    assert trials_needed(0.1, 0.2) == pytest.approx(200, abs=5)  # Cohen's h = 0.284
    assert trials_needed(0.3, 0.3) is None
    assert detectable_difference(0.9, 5) is None


def test_the_power_is_what_simulation_finds() -> None:
    rise = detectable_difference(0.3, 64)
    rng = np.random.default_rng(2)
    draws = rng.binomial(64, (0.3, 0.3 + rise), size=(3000, 2))
    found = [difference_interval((int(b), 64), (int(a), 64))[0] > 0 for a, b in draws]
    assert np.mean(found) == pytest.approx(0.8, abs=0.04)
