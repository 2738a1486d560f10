from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from buildarena_benchmark.statistics import (
    agreement,
    cost_per_success,
    holm,
    paired_indicators,
    paired_successes,
    token_bins,
)


def test_mcnemar_of_a_hand_worked_case() -> None:
    # 8 seeds speak: 7 for the first, 1 for the second; P = 2 (1 + 8) / 2^8
    first = [True] * 7 + [False] + [True] * 4
    second = [False] * 7 + [True] + [True] * 4
    test = paired_successes(first, second)
    assert test.p_value == pytest.approx(18 / 256)
    assert (test.pairs, test.difference) == (12, 0.5)


def test_wilcoxon_of_a_case_that_can_be_counted() -> None:
    difference = [1.0, 2.0, 3.0, 4.0, -5.0]
    sums = [
        sum(place for place, sign in zip(range(1, 6), signs, strict=True) if sign)
        for signs in product([0, 1], repeat=5)
    ]
    p_value = 2 * min(np.mean([s >= 10 for s in sums]), np.mean([s <= 10 for s in sums]))
    assert paired_indicators(difference, [0.0] * 5).p_value == pytest.approx(p_value)


def test_no_pairs_and_no_differences() -> None:
    assert paired_successes([], []) is None
    assert paired_indicators([], []) is None
    assert paired_successes([True, False], [True, False]).p_value == 1.0
    assert paired_indicators([0.0, 3.0], [0.0, 3.0]).p_value == 1.0


def test_holm_of_a_hand_worked_case() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([]) == []
    assert holm([0.4, 0.9]) == pytest.approx([0.8, 0.9])


def stepwise(p_values: list[float], error: float) -> set[int]:
    """Holm's procedure as he wrote it: reject while p is small enough, then stop."""
    rejected: set[int] = set()
    left = sorted(range(len(p_values)), key=lambda i: p_values[i])
    while left and p_values[left[0]] <= error / len(left):
        rejected.add(left.pop(0))
    return rejected


@given(st.lists(st.floats(0, 1), max_size=12), st.sampled_from([0.01, 0.05, 0.2]))
def test_holm_rejects_what_the_stepwise_procedure_rejects(p_values, error) -> None:
    adjusted = holm(p_values)
    assert {i for i, p in enumerate(adjusted) if p <= error * (1 - 1e-9)} <= stepwise(
        p_values, error
    )
    assert stepwise(p_values, error) <= {i for i, p in enumerate(adjusted) if p <= error * 1.000001}


def test_mcnemar_finds_nothing_between_equal_models(subtests) -> None:
    for error, most in [(0.05, 0.07)]:
        with subtests.test(error=error):
            rng = np.random.default_rng(13)
            found = 0
            for _ in range(800):
                a, b = rng.random((2, 64)) < 0.4
                found += paired_successes(a.tolist(), b.tolist()).p_value < error
            assert found / 800 <= most


def test_agreement_of_a_hand_worked_case() -> None:
    # 20 yes/yes, 5 yes/no, 10 no/yes, 15 no/no: 0.70 agree, 0.50 by chance
    pairs = [(1, 1)] * 20 + [(1, 0)] * 5 + [(0, 1)] * 10 + [(0, 0)] * 15
    first = [(bool(a), float(i)) for i, (a, _) in enumerate(pairs)]
    second = [(bool(b), 2.0 * i + 1) for i, (_, b) in enumerate(pairs)]
    found = agreement(first, second)
    assert found.same_verdict == pytest.approx(0.7)
    assert found.kappa == pytest.approx(0.4)
    assert found.rank_correlation == pytest.approx(1.0)


def test_agreement_where_nothing_varies() -> None:
    found = agreement([(False, 0.0)] * 3, [(False, 0.0)] * 3)
    assert (found.same_verdict, found.kappa, found.rank_correlation) == (1.0, None, None)
    assert agreement([], []) is None
    with pytest.raises(ValueError, match="cannot be paired"):
        agreement([(True, 1.0)], [])


def test_token_bins_of_a_hand_worked_case() -> None:
    tokens = np.array([10.0, 20.0, 100.0, 500.0, 1000.0])
    bins = token_bins(tokens, np.array([1.0, 0.0, 4.0, 2.0, 0.0]), bins=2)
    assert [(b.low, b.high, b.trials) for b in bins] == [(10, 100, 2), (100, 1000, 3)]
    assert bins[0].mean == pytest.approx(0.125)
    assert (bins[1].mean, bins[1].median) == (pytest.approx(0.5), pytest.approx(0.5))


@given(st.lists(st.tuples(st.integers(0, 10**6), st.floats(0, 1500)), max_size=40))
def test_every_trial_is_in_one_bin(trials) -> None:
    tokens = np.array([t for t, _ in trials], float)
    bins = token_bins(tokens, np.array([v for _, v in trials], float))
    assert sum(b.trials for b in bins) == len(trials)
    assert all(b.mean is None or 0 <= b.mean <= 1 for b in bins)


def test_the_cost_of_a_success_includes_the_failures() -> None:
    assert cost_per_success([0.5, 0.25, 0.25], 2) == pytest.approx(0.5)
    assert cost_per_success([0.5], 0) is None
    assert cost_per_success([None, None], 1) is None
    assert cost_per_success([0.5, None], 1) is None
