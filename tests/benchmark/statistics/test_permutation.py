from itertools import combinations

import numpy as np
import pytest
from scipy.stats import hypergeom

from buildarena_benchmark.statistics import PairTests, Sample, pair_tests, permutation


def evidence(pairs) -> PairTests:
    """The tests of pairs of models, each given by its trials."""
    return pair_tests([(Sample.of(first), Sample.of(second)) for first, second in pairs])


def counts(first: tuple[int, int], second: tuple[int, int], value: float = 300.0):
    """Trials of two models by their successes, which are all worth the same."""
    return tuple(
        np.column_stack([won, won * value])
        for successes, trials in (first, second)
        for won in [(np.arange(trials) < successes).astype(float)]
    )


def dealt(pooled: np.ndarray, number: int) -> float:
    """The two-sided p-value by dealing the labels in every way."""
    standard = (pooled - pooled.mean(axis=0)) / pooled.std(axis=0)
    weight = standard.sum(axis=1)
    sums = [weight[list(chosen)].sum() for chosen in combinations(range(len(pooled)), number)]
    return 2 * float(np.mean(np.array(sums) >= abs(weight[:number].sum()) - 1e-9))


def test_counts_alone_give_fishers_p_value_from_above(subtests) -> None:
    for first, second in [
        ((9, 64), (1, 64)),
        ((10, 64), (0, 64)),
        ((38, 64), (2, 64)),
        ((7, 8), (4, 64)),
        ((8, 8), (3, 64)),
        ((2, 2), (1, 64)),
        ((12, 16), (0, 16)),
        ((260, 740), (140, 740)),
    ]:
        with subtests.test(first=first):
            (won, of), (lost, among) = first, second
            exact = 2 * float(hypergeom.sf(won - 1, of + among, won + lost, of))
            found = evidence([counts(first, second)])
            assert exact * 0.98 <= found.p_value[0] <= 3 * exact
            assert found.z[0] > 0
            turned = evidence([counts(second, first)])
            assert turned.p_value[0] == pytest.approx(found.p_value[0])
            assert turned.z[0] == pytest.approx(-found.z[0])


def test_p_values_are_those_of_dealing_every_label_from_above(subtests) -> None:
    for seed in range(6):
        with subtests.test(seed=seed):
            rng = np.random.default_rng(seed)
            won = (rng.random(16) < [*[0.9] * 8, *[0.3] * 8]).astype(float)
            pooled = np.column_stack([won, won * rng.lognormal(5, 0.8, 16)])
            found = float(evidence([(pooled[:8], pooled[8:])]).p_value[0])
            exact = min(1.0, dealt(pooled, 8))
            assert exact * 0.95 <= found
            # Sixteen trials make wide gaps, and the correction of half a gap is large.
            assert found <= 10 * exact


def test_pairs_are_tested_alike_alone_and_among_others() -> None:
    rng = np.random.default_rng(4)
    pairs = [
        tuple(np.column_stack([w, w * 9.0]) for w in (rng.random((2, n)) < 0.5).astype(float))
        for n in (5, 64, 200)
    ]
    together = evidence(pairs)
    for number, pair in enumerate(pairs):
        alone = evidence([pair])
        assert alone.p_value[0] == pytest.approx(together.p_value[number], rel=1e-6)
    assert len(evidence([]).p_value) == 0


def test_where_nothing_varies_nothing_is_said() -> None:
    found = evidence([counts((0, 64), (0, 64)), counts((64, 64), (64, 64))])
    assert found.p_value.tolist() == [1.0, 1.0]
    assert found.z.tolist() == [0.0, 0.0]
    assert not found.informative.any()
    # Digits that differ by rounding are no difference.
    same = np.column_stack([np.ones(64), np.full(64, 0.1 + 0.2)])
    other = np.column_stack([np.ones(64), np.full(64, 0.3)])
    assert evidence([(same, other)]).p_value[0] == 1.0


def test_very_few_trials_say_nothing_apart(subtests) -> None:
    for trials in [1, 2, 3]:
        with subtests.test(trials=trials):
            found = evidence([counts((trials, trials), (0, trials))])
            assert found.p_value[0] > 0.05


def test_a_scale_of_the_indicator_changes_nothing() -> None:
    rng = np.random.default_rng(5)
    first, second = (
        np.column_stack([w, w * rng.lognormal(5, 1, 40)])
        for w in (rng.random((2, 40)) < [[0.7], [0.4]]).astype(float)
    )
    scaled = [(first * [1, 1e-6], second * [1, 1e-6]), (first * [1, 1e9], second * [1, 1e9])]
    p_value = evidence([(first, second)]).p_value[0]
    assert evidence(scaled).p_value == pytest.approx([p_value, p_value], rel=1e-6)


def test_models_of_equal_means_and_unequal_spread_are_not_told_apart() -> None:
    """Few trials that vary much beside many that vary little: labels alone would mislead."""
    rng = np.random.default_rng(6)
    wrong = 0
    for _ in range(300):
        pair = tuple(
            np.column_stack([np.ones(n), rng.normal(300, spread, n)])
            for n, spread in ((16, 100), (256, 10))
        )
        wrong += evidence([pair]).p_value[0] <= 0.01
    assert wrong <= 12


SHAPES = {
    "exponential": lambda rng, n: rng.exponential(1.0, n),
    "normal": lambda rng, n: rng.normal(100, 20, n),
    "heavy": lambda rng, n: rng.lognormal(3, 1, n),
    "two designs": lambda rng, n: np.where(
        rng.random(n) < 0.5, rng.normal(10, 1, n), rng.normal(500, 30, n)
    ),
}


def test_near_trials_together_say_what_each_says(monkeypatch, subtests) -> None:
    for shape in SHAPES:
        for trials in [200, 600, 2000]:
            with subtests.test(shape=shape, trials=trials), monkeypatch.context() as patch:
                rng = np.random.default_rng(1)

                def model() -> np.ndarray:
                    won = rng.random(trials) < rng.uniform(0.45, 0.55)
                    share = np.where(won, rng.integers(1, 5, trials), 0) / 4
                    indicator = SHAPES[shape](rng, trials) * rng.uniform(0.95, 1.05)
                    return np.column_stack([share, np.where(won, indicator, 0.0)])

                models = [model() for _ in range(6)]
                near = [Sample.of(model) for model in models]
                for sample, each in zip(near, models, strict=True):
                    assert sample.times @ sample.figures == pytest.approx(each.sum(axis=0))
                    assert len(sample.times) < trials / 2
                together = pair_tests(list(combinations(near, 2)))
                patch.setattr(permutation, "MANY", trials)
                apart = evidence(combinations(models, 2))
                assert np.abs(together.z - apart.z).max() < 0.005
                assert np.abs(together.z - apart.z).max() > 0
