from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import bootstrap

from buildarena_benchmark.statistics import mean_interval, resampled_means


def test_the_interval_is_scipys_up_to_its_own_noise() -> None:
    values = np.random.default_rng(3).exponential(2.0, 64)
    theirs = bootstrap(
        (values,), np.mean, n_resamples=20_000, method="BCa", rng=np.random.default_rng(4)
    ).confidence_interval
    means = resampled_means(values[:, None], seed=1, replicates=20_000)[:, 0]
    assert mean_interval(values, means) == pytest.approx((theirs.low, theirs.high), rel=0.01)


def test_means_of_resamples_have_the_spread_of_the_closed_form() -> None:
    values = np.random.default_rng(5).normal(10, 3, 64)
    means = resampled_means(values[:, None], seed=0, replicates=20_000)[:, 0]
    assert means.mean() == pytest.approx(values.mean(), abs=0.02)
    assert means.std() == pytest.approx(values.std() / 8, rel=0.03)


def test_the_order_of_trials_does_not_matter() -> None:
    rng = np.random.default_rng(6)
    values = np.column_stack([rng.integers(0, 2, 40), rng.normal(size=40)]).astype(float)
    shuffled = values[rng.permutation(40)]
    assert np.array_equal(resampled_means(values, seed=7), resampled_means(shuffled, seed=7))
    for seed in range(20):
        many = np.random.default_rng(seed).exponential(0.1, 900)
        assert mean_interval(many) == mean_interval(rng.permutation(many))


def test_figures_of_one_trial_stay_together() -> None:
    column = np.random.default_rng(8).normal(size=30)
    means = resampled_means(np.column_stack([column, 2 * column]), seed=9)
    assert np.allclose(means[:, 1], 2 * means[:, 0])


@pytest.mark.parametrize(
    "draw",
    [
        lambda rng: rng.normal(5, 2, 64),
        lambda rng: rng.exponential(3, 64),
        # Most trials of a hard task fail and have an indicator of 0.
        lambda rng: rng.exponential(300, 64) * (rng.random(64) < 0.45),
    ],
    ids=["normal", "skewed", "many zeros"],
)
def test_the_interval_covers_as_often_as_it_says(draw) -> None:
    rng = np.random.default_rng(10)
    hits, total = 0, 1500
    samples = [draw(rng) for _ in range(total)]
    truth = float(np.mean([draw(rng).mean() for _ in range(40_000)]))
    for number, values in enumerate(samples):
        low, high = mean_interval(values, seed=number)
        hits += low <= truth <= high
    assert hits / total == pytest.approx(0.95, abs=0.02)


def test_too_little_to_resample() -> None:
    assert mean_interval(np.array([])) is None
    assert mean_interval(np.array([3.0])) is None
    assert mean_interval(np.zeros(64)) == (0.0, 0.0)
    assert mean_interval(np.full(10, 0.1)) == pytest.approx((0.1, 0.1))
