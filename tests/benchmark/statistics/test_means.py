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
    wilson_interval,
)

loads = arrays(float, st.integers(0, 40), elements=st.sampled_from([0.0, 3.0, 20.0, 250.0, 1500.0]))


@pytest.mark.nightly(keep=24)
@pytest.mark.parametrize(
    ("trials", "rate"), [(16, 0.9), (12, 1.0), (24, 0.6), (48, 0.3), (128, 0.1), (512, 0.03)]
)
@pytest.mark.parametrize("name", LOADS)
def test_intervals_of_means_hold_as_often_as_they_say(name, trials, rate) -> None:
    found = coverage(LOADS[name], trials, rate, samples=400, seed=21)
    assert found.shown > 0.7
    # Of 400 samples of an interval that holds in 95 %, fewer than 92 % hold in 1 of 200 trials.
    assert found.covered >= 0.92


def test_few_successes_are_covered_or_too_few(subtests) -> None:
    """Where few trials succeed, resampling covers too few: it knows only the successes it saw."""
    for failures in [0.0, 8.0]:
        with subtests.test(failures=failures):
            lognormal = LOADS["lognormal, sigma 0.8"]
            found = coverage(lognormal, 128, 0.04, samples=6000, seed=22, failures=failures)
            assert 0.02 < found.shown < 0.08
            assert found.covered >= 0.93


def test_a_rate_that_is_never_missed_for_want_of_failures() -> None:
    """Twelve successes of twelve do not say that every trial succeeds."""
    low, high = mean_interval(np.full(12, 300.0))
    assert low < 0.9 * 300 < high == 300


def test_too_few_successes_give_no_interval(subtests) -> None:
    for successes in range(MIN_SUCCESSES):
        for trials in [10, 64]:
            with subtests.test(successes=successes, trials=trials):
                values = np.zeros(trials)
                values[:successes] = 300.0
                assert mean_interval(values) is None
                # Failures that moved a little are no successes.
                assert mean_interval(np.maximum(values, 3.0), values > 0) is None


def test_what_is_no_number_is_refused() -> None:
    with pytest.raises(ValueError, match="nan"):
        mean_interval(np.array([1.0, np.nan]))


@given(loads, st.randoms(use_true_random=False))
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


def test_many_normal_values_have_students_interval() -> None:
    values = np.random.default_rng(3).normal(300, 30, 400)
    low, high = mean_interval(values)
    half = 1.966 * values.std(ddof=1) / 20
    # All 400 succeeded; that one in a hundred might not is what the lower end adds.
    assert high - values.mean() == pytest.approx(half, rel=0.1)
    assert half < values.mean() - low < half + 0.01 * 300


@given(st.integers(1, 300).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_the_exact_interval_is_scipys(count) -> None:
    theirs = binomtest(*count).proportion_ci(method="exact")
    assert exact_interval(*count) == pytest.approx((theirs.low, theirs.high), abs=1e-9)


def covered(interval, trials: int, rate: float) -> float:
    """How often an interval holds a rate, exactly."""
    return sum(
        float(binom.pmf(won, trials, rate))
        for won in range(trials + 1)
        if interval(won, trials)[0] <= rate <= interval(won, trials)[1]
    )


def test_exact_intervals_hold_every_rate_where_wilsons_do_not(subtests) -> None:
    for trials in [8, 16, 32, 64]:
        with subtests.test(trials=trials):
            rates = [0.16 / trials, 0.01, 0.03, 0.1, 0.3, 0.6, 0.9, 0.99, 1.0]
            assert min(covered(exact_interval, trials, rate) for rate in rates) >= 0.95
            assert min(covered(wilson_interval, trials, rate) for rate in rates) < 0.93


def test_exact_intervals_hold_means_of_shares(subtests) -> None:
    for worlds in [2, 4, 16]:
        for low, high in [(0.0, 0.1), (0.0, 1.0), (0.4, 0.6), (0.9, 1.0)]:
            for sure in [0.0, 0.7]:
                with subtests.test(worlds=worlds, low=low, sure=sure):
                    # A machine succeeds in each world with a chance of its own: always, or never.
                    rng = np.random.default_rng(worlds)
                    chances = rng.choice([low, high, (low + high) / 2], size=(400, 16))
                    chances = np.where(rng.random(chances.shape) < sure, low, chances)
                    rate = sure * low + (1 - sure) * (low + high) / 2
                    sums = (rng.binomial(worlds, chances) / worlds).sum(axis=1)
                    ends = {total: exact_interval(total, 16) for total in set(sums.tolist())}
                    held = [ends[total][0] <= rate <= ends[total][1] for total in sums.tolist()]
                    assert np.mean(held) >= 0.95 - 2 * (0.05 * 0.95 / 400) ** 0.5


def test_intervals_that_are_shown_from_five_on_hold_when_they_are_shown(subtests) -> None:
    for rate in [0.01, 0.05, 0.1, 0.3, 0.9]:
        for trials in [8, 20, 64]:
            with subtests.test(rate=rate, trials=trials):
                shown = held = 0.0
                for won in range(5, trials + 1):
                    low, high = exact_interval(won, trials, at_least=5)
                    chance = float(binom.pmf(won, trials, rate))
                    shown += chance
                    held += chance * (low <= rate <= high)
                assert held / shown >= 0.95


def test_counts_that_no_interval_exists_for() -> None:
    for successes, trials, at_least in ((3, 2, 0), (0, 0, 0), (4, 9, 5)):
        with pytest.raises(ValueError, match=f"{successes} successes of {trials}"):
            exact_interval(successes, trials, at_least=at_least)
