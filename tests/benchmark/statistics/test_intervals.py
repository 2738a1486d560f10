"""Intervals hold the truth as often as they say, and pass@k counts subsets."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import binom, binomtest
from support.boards.made_up_trials import LOADS, coverage

from buildarena_benchmark.statistics import (
    MIN_SUCCESSES,
    exact_interval,
    mean_interval,
    mean_rate_interval,
    wilson_interval,
)
from buildarena_benchmark.statistics.power import detectable_difference, trials_needed
from buildarena_benchmark.statistics.proportions import difference_interval, pass_at_k, pass_hat_k

COUNTS = st.integers(1, 300).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))
FIGURES = st.sampled_from([0.0, 3.0, 20.0, 250.0, 1500.0])
VALUES = arrays(float, st.integers(0, 40), elements=FIGURES)
SHARES = st.lists(st.sampled_from([0.0, 0.25, 1 / 3, 0.5, 0.75, 1.0]), min_size=1, max_size=9)


# Means


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize(
    ("trials", "rate"), [(16, 0.9), (12, 1.0), (24, 0.6), (48, 0.3), (128, 0.1), (512, 0.03)]
)
def test_intervals_of_means_hold_as_often_as_they_say(trials, rate, subtests) -> None:
    for name, loads in LOADS.items():
        with subtests.test(name=name):
            found = coverage(loads, trials, rate, samples=400, seed=21)
            assert found.shown > 0.7
            # Of an interval that holds in 95 %, fewer than 92 % of 400 hold in 1 of 200 trials.
            assert found.covered >= 0.92


def test_few_successes_are_covered_or_too_few() -> None:
    """Where few trials succeed, resampling covers too few: it knows only the successes it saw."""
    lognormal = LOADS["lognormal, sigma 0.8"]
    for failures in (0.0, 8.0):
        found = coverage(lognormal, 128, 0.04, samples=4000, seed=22, failures=failures)
        assert 0.02 < found.shown < 0.08
        assert found.covered >= 0.92


def test_twelve_successes_of_twelve_do_not_say_that_every_trial_succeeds() -> None:
    low, high = mean_interval(np.full(12, 300.0))
    assert low < 0.9 * 300 < high == 300


def test_too_few_successes_give_no_interval_and_no_number_is_refused() -> None:
    values = np.zeros(64)
    values[: MIN_SUCCESSES - 1] = 300.0
    assert mean_interval(values) is None
    # Failures that moved a little are not successes.
    assert mean_interval(np.maximum(values, 3.0), values > 0) is None
    with pytest.raises(ValueError, match="nan"):
        mean_interval(np.array([1.0, np.nan]))


@given(VALUES, st.randoms(use_true_random=False))
def test_intervals_hold_the_mean_in_whatever_order(values, rng) -> None:
    ends = mean_interval(values)
    assert (ends is None) == ((values > 0).sum() < MIN_SUCCESSES)
    if ends is None:
        return
    assert 0 <= ends[0] <= values.mean() * (1 + 1e-12)
    assert ends[1] >= values.mean() * (1 - 1e-12)
    shuffled = list(values)
    rng.shuffle(shuffled)
    assert mean_interval(np.array(shuffled)) == ends
    assert mean_interval(2 * values) == pytest.approx((2 * ends[0], 2 * ends[1]))


# Rates


@given(COUNTS)
def test_intervals_of_rates_are_scipys(count) -> None:
    for method, interval in (("wilson", wilson_interval), ("exact", exact_interval)):
        theirs = binomtest(*count).proportion_ci(method=method)
        assert interval(*count) == pytest.approx((theirs.low, theirs.high), abs=1e-9)


def test_impossible_counts_are_refused() -> None:
    for count in ((0, 0), (3, 2), (-1, 2)):
        with pytest.raises(ValueError, match="have no interval"):
            wilson_interval(*count)
    for successes, trials, at_least in ((3, 2, 0), (0, 0, 0), (4, 9, 5)):
        with pytest.raises(ValueError, match=f"{successes} successes of {trials}"):
            exact_interval(successes, trials, at_least=at_least)


def test_exact_intervals_hold_every_rate_where_wilsons_do_not() -> None:
    def least_held(interval, trials: int) -> float:
        won = np.arange(trials + 1)
        low, high = np.array([interval(int(k), trials) for k in won]).T
        rates = (0.16 / trials, 0.01, 0.03, 0.1, 0.3, 0.6, 0.9, 0.99, 1.0)
        return min(binom.pmf(won, trials, r)[(low <= r) & (r <= high)].sum() for r in rates)

    for trials in (8, 16, 32, 64):
        assert least_held(exact_interval, trials) >= 0.95
        assert least_held(wilson_interval, trials) < 0.93


def test_exact_intervals_hold_means_of_shares(subtests) -> None:
    """A machine succeeds in each world with its own chance: always, or never."""
    for worlds in (2, 16):
        for low, high in ((0.0, 0.1), (0.0, 1.0), (0.4, 0.6), (0.9, 1.0)):
            for sure in (0.0, 0.7):
                with subtests.test(worlds=worlds, low=low, sure=sure):
                    rng = np.random.default_rng(worlds)
                    chances = rng.choice([low, high, (low + high) / 2], size=(400, 16))
                    chances = np.where(rng.random(chances.shape) < sure, low, chances)
                    rate = sure * low + (1 - sure) * (low + high) / 2
                    sums = (rng.binomial(worlds, chances) / worlds).sum(axis=1)
                    ends = {total: exact_interval(total, 16) for total in set(sums.tolist())}
                    held = [ends[total][0] <= rate <= ends[total][1] for total in sums.tolist()]
                    assert np.mean(held) >= 0.95 - 2 * (0.05 * 0.95 / 400) ** 0.5


def test_intervals_of_mean_rates_hold_whatever_the_tasks_and_their_trials(subtests) -> None:
    for trials in ([4] * 9, [8, 64, 8], [16] * 32):
        for chances in ([0.1], [0.98], [0.9, 0.01], [0.5, 0.0, 0.0, 0.0]):
            with subtests.test(trials=trials[:2], chances=chances):
                tasks = np.resize(chances, len(trials))
                won = np.random.default_rng(0).binomial(trials, tasks, size=(2000, len(trials)))
                told = [
                    mean_rate_interval([*zip(row / trials, trials, strict=True)]) for row in won
                ]
                held = [low <= tasks.mean() <= high for low, high in told]
                assert np.mean(held) >= 0.95 - 2 * (0.05 * 0.95 / 2000) ** 0.5
    assert mean_rate_interval([(0.5, 8)]) == exact_interval(4, 8)


def test_intervals_that_are_shown_from_five_on_hold_when_they_are_shown() -> None:
    for rate in (0.01, 0.05, 0.1, 0.3, 0.9):
        for trials in (8, 20, 64):
            won = np.arange(5, trials + 1)
            ends = np.array([exact_interval(int(k), trials, at_least=5) for k in won]).T
            chance = binom.pmf(won, trials, rate)
            held = chance[(ends[0] <= rate) & (rate <= ends[1])].sum()
            assert held >= 0.95 * chance.sum() - 1e-12, (rate, trials)


def test_the_interval_of_a_difference_is_newcombes_own_example() -> None:
    # Newcombe 1998, table II, case (a): 56/70 - 48/80, method 10.
    assert difference_interval((56, 70), (48, 80)) == pytest.approx((0.0524, 0.3339), abs=5e-5)


def test_the_interval_of_a_difference_covers_as_often_as_it_says() -> None:
    rng = np.random.default_rng(1)
    hits = []
    for rate_1, rate_2 in ((0.1, 0.3), (0.5, 0.5), (0.8, 0.6), (0.2, 0.05)):
        for a, b in rng.binomial(64, (rate_1, rate_2), size=(1500, 2)):
            low, high = difference_interval((int(a), 64), (int(b), 64))
            hits.append(low <= rate_1 - rate_2 <= high)
    assert np.mean(hits) == pytest.approx(0.95, abs=0.02)


@given(SHARES, st.data())
def test_pass_at_k_and_pass_hat_k_count_subsets_of_chances(shares, data) -> None:
    k = data.draw(st.integers(1, len(shares)))
    subsets = [np.array(subset) for subset in combinations(shares, k)]
    assert pass_at_k(shares, k) == pytest.approx(np.mean([1 - np.prod(1 - s) for s in subsets]))
    assert pass_hat_k(shares, k) == pytest.approx(np.mean([np.prod(s) for s in subsets]))
    assert pass_at_k(shares, len(shares) + 1) is pass_hat_k(shares, len(shares) + 1) is None


def test_64_samples_show_a_rise_from_10_to_29_percent_but_not_to_20() -> None:
    rise = detectable_difference(0.1, 64)
    assert rise == pytest.approx(0.19, abs=0.02)
    assert trials_needed(0.1, 0.1 + rise + 1e-9) == 64
    assert trials_needed(0.1, 0.2) == pytest.approx(200, abs=5)  # Cohen's h = 0.284
    assert trials_needed(0.3, 0.3) is None
    assert detectable_difference(0.9, 5) is None


def test_the_power_is_what_simulation_finds() -> None:
    rise = detectable_difference(0.3, 64)
    draws = np.random.default_rng(2).binomial(64, (0.3, 0.3 + rise), size=(3000, 2))
    found = [difference_interval((int(b), 64), (int(a), 64))[0] > 0 for a, b in draws]
    assert np.mean(found) == pytest.approx(0.8, abs=0.04)
