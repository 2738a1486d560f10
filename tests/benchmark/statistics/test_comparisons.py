"""Tests of pairs of models: against exact values, by counting, and by simulation."""

from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import hypergeom

from buildarena_benchmark.statistics import permutation
from buildarena_benchmark.statistics.means import cost_per_success
from buildarena_benchmark.statistics.permutation import PairTests, Sample, pair_tests
from buildarena_benchmark.statistics.ranking import holm


def stepwise(p_values: list[float], error: float) -> set[int]:
    """Holm's procedure as he wrote it: reject while p is small enough, then stop."""
    rejected: set[int] = set()
    left = sorted(range(len(p_values)), key=lambda i: p_values[i])
    while left and p_values[left[0]] <= error / len(left):
        rejected.add(left.pop(0))
    return rejected


@given(st.lists(st.floats(0, 1), max_size=12), st.sampled_from([0.01, 0.05, 0.2]))
def test_holm_rejects_what_the_stepwise_procedure_rejects(p_values, error) -> None:
    adjusted, expected = holm(p_values), stepwise(p_values, error)
    assert {i for i, p in enumerate(adjusted) if p <= error * (1 - 1e-9)} <= expected
    assert expected <= {i for i, p in enumerate(adjusted) if p <= error * 1.000001}
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])


def test_the_cost_of_a_success_includes_the_failures() -> None:
    assert cost_per_success([0.5, 0.25, 0.25], 2) == pytest.approx(0.5)
    for costs, successes in (([0.5], 0), ([None, None], 1), ([0.5, None], 1)):
        assert cost_per_success(costs, successes) is None


# Unpaired models


def evidence(pairs) -> PairTests:
    """The tests of pairs of models, each given by its trials."""
    return pair_tests([(Sample.of(first), Sample.of(second)) for first, second in pairs])


def counts(first: tuple[int, int], second: tuple[int, int], value: float = 300.0):
    """Trials of two models by their successes, which are all worth the same."""
    won = [(np.arange(trials) < successes).astype(float) for successes, trials in (first, second)]
    return tuple(np.column_stack([each, each * value]) for each in won)


def dealt(pooled: np.ndarray, number: int) -> float:
    """The two-sided p-value by dealing the labels in every way."""
    standard = (pooled - pooled.mean(axis=0)) / pooled.std(axis=0)
    weight = standard.sum(axis=1)
    sums = [weight[list(chosen)].sum() for chosen in combinations(range(len(pooled)), number)]
    return 2 * float(np.mean(np.array(sums) >= abs(weight[:number].sum()) - 1e-9))


def test_counts_alone_give_fishers_p_value_from_above() -> None:
    for first, second in (
        ((9, 64), (1, 64)),
        ((10, 64), (0, 64)),
        ((38, 64), (2, 64)),
        ((7, 8), (4, 64)),
        ((8, 8), (3, 64)),
        ((2, 2), (1, 64)),
        ((12, 16), (0, 16)),
        ((260, 740), (140, 740)),
    ):
        (won, of), (lost, among) = first, second
        exact = 2 * float(hypergeom.sf(won - 1, of + among, won + lost, of))
        found = evidence([counts(first, second), counts(second, first)])
        assert exact * 0.98 <= found.p_value[0] <= 3 * exact, first
        assert found.z[0] > 0
        assert found.p_value[1] == pytest.approx(found.p_value[0])
        assert found.z[1] == pytest.approx(-found.z[0])


def test_p_values_are_those_of_dealing_every_label_from_above() -> None:
    for seed in range(4):
        rng = np.random.default_rng(seed)
        won = (rng.random(16) < [*[0.9] * 8, *[0.3] * 8]).astype(float)
        pooled = np.column_stack([won, won * rng.lognormal(5, 0.8, 16)])
        found = float(evidence([(pooled[:8], pooled[8:])]).p_value[0])
        exact = min(1.0, dealt(pooled, 8))
        # Sixteen trials make wide gaps, and the correction of half a gap is large.
        assert exact * 0.95 <= found <= 10 * exact, seed


def test_pairs_are_tested_alike_alone_and_among_others_and_on_any_scale() -> None:
    rng = np.random.default_rng(4)
    pairs = [
        tuple(
            np.column_stack([w, w * rng.lognormal(5, 1, n)])
            for w in (rng.random((2, n)) < [[0.7], [0.4]]).astype(float)
        )
        for n in (5, 64, 200)
    ]
    together = evidence(pairs).p_value
    for scale in (1, 1e-6, 1e9):
        alone = [evidence([[each * [1, scale] for each in pair]]).p_value[0] for pair in pairs]
        assert alone == pytest.approx(together, rel=1e-6)
    assert len(evidence([]).p_value) == 0


def test_where_nothing_varies_or_few_try_nothing_is_said() -> None:
    found = evidence([counts((0, 64), (0, 64)), counts((64, 64), (64, 64))])
    assert (found.p_value.tolist(), found.z.tolist()) == ([1.0, 1.0], [0.0, 0.0])
    assert not found.informative.any()
    # Digits that differ by rounding are not a difference.
    same = np.column_stack([np.ones(64), np.full(64, 0.1 + 0.2)])
    other = np.column_stack([np.ones(64), np.full(64, 0.3)])
    assert evidence([(same, other)]).p_value[0] == 1.0
    assert (evidence([counts((n, n), (0, n)) for n in (1, 2, 3)]).p_value > 0.05).all()


def test_models_of_equal_means_and_unequal_spread_are_not_told_apart() -> None:
    """Few trials that vary much and many that vary little: labels alone would mislead."""
    rng = np.random.default_rng(6)
    pairs = [
        tuple(
            np.column_stack([np.ones(n), rng.normal(300, spread, n)])
            for n, spread in ((16, 100), (256, 10))
        )
        for _ in range(300)
    ]
    assert (evidence(pairs).p_value <= 0.01).sum() <= 12


SHAPES = {
    "exponential": lambda rng, n: rng.exponential(1.0, n),
    "heavy": lambda rng, n: rng.lognormal(3, 1, n),
    "two designs": lambda rng, n: np.where(
        rng.random(n) < 0.5, rng.normal(10, 1, n), rng.normal(500, 30, n)
    ),
}


def test_near_trials_together_say_what_each_says(monkeypatch, subtests) -> None:
    for (shape, draw), trials in product(SHAPES.items(), (200, 2000)):
        with subtests.test(shape=shape, trials=trials), monkeypatch.context() as patch:
            rng = np.random.default_rng(1)
            models = []
            for _ in range(4):
                won = rng.random(trials) < rng.uniform(0.45, 0.55)
                share = np.where(won, rng.integers(1, 5, trials), 0) / 4
                indicator = draw(rng, trials) * rng.uniform(0.95, 1.05)
                models.append(np.column_stack([share, np.where(won, indicator, 0.0)]))
            near = [Sample.of(model) for model in models]
            for sample, each in zip(near, models, strict=True):
                assert sample.times @ sample.figures == pytest.approx(each.sum(axis=0))
                assert len(sample.times) < trials / 2
            together = pair_tests(list(combinations(near, 2)))
            patch.setattr(permutation, "MANY", trials)
            apart = evidence(combinations(models, 2))
            assert 0 < np.abs(together.z - apart.z).max() < 0.005
