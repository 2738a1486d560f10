from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import rankdata

from buildarena_benchmark.statistics import (
    PairTests,
    Sample,
    adjusted,
    combined,
    mean_ranks,
    pair_tests,
    rank_models,
)
from buildarena_benchmark.statistics.ranking import descending_ranks

tables = arrays(float, (4, 5), elements=st.sampled_from([0.0, 0.1, 0.25, 0.5, 1.0]))


@given(tables)
def test_ranks_are_scipys(table) -> None:
    theirs = rankdata(-table, method="average", axis=1)
    assert np.array_equal(descending_ranks(table), theirs)


def test_a_hand_worked_ranking() -> None:
    # Two tasks, three models; the second and third tie in success on the first task.
    success = np.array([[0.9, 0.1, 0.1], [0.5, 0.4, 0.6]])
    indicator = np.array([[30.0, 10.0, 5.0], [7.0, 8.0, 9.0]])
    assert mean_ranks(success, indicator) == pytest.approx(
        [(1 + 1 + 2 + 3) / 4, (2.5 + 2 + 3 + 2) / 4, (2.5 + 3 + 1 + 1) / 4]
    )


@given(tables, tables, st.permutations(range(5)), st.permutations(range(4)))
def test_names_and_order_of_models_and_tasks_do_not_matter(success, indicator, models, tasks):
    plain = mean_ranks(success, indicator)
    mixed = mean_ranks(success[tasks][:, models], indicator[tasks][:, models])
    assert mixed == pytest.approx(plain[models])


@given(tables, tables, st.integers(0, 3), st.integers(0, 4))
def test_doing_better_never_harms(success, indicator, task, model) -> None:
    before = mean_ranks(success, indicator)
    success[task, model] += 0.3
    after = mean_ranks(success, indicator)
    assert after[model] <= before[model]
    others = np.arange(5) != model
    assert np.all(after[others] >= before[others] - 1e-12)


def trials_of(successes: list[int], trials: int) -> list[np.ndarray]:
    """One model's trials for each number of successes."""
    won = [(np.arange(trials) < count).astype(float) for count in successes]
    return [np.column_stack([w, w]) for w in won]


def ranked(successes: list[int], trials: int, tasks: int = 1):
    row = trials_of(successes, trials)
    tests = combined(
        [pair_tests(list(combinations([Sample.of(trials) for trials in row], 2)))] * tasks
    )
    rates = np.array([[count / trials for count in successes]] * tasks)
    return rank_models((rates, rates), tests, adjusted([tests])[0])


def test_models_that_cannot_be_told_apart_share_a_rank() -> None:
    ranking = ranked([51, 33, 32, 6], 64, tasks=5)
    assert ranking.rank.tolist() == [1, 2, 2, 4]
    assert ranking.low.tolist() == [1, 2, 2, 4]
    assert ranking.high.tolist() == [1, 3, 3, 4]
    assert not ranking.better.diagonal().any()


def test_equal_models_all_share_the_first_rank() -> None:
    ranking = ranked([32, 32, 32, 32], 64, tasks=3)
    assert ranking.rank.tolist() == [1, 1, 1, 1]
    assert ranking.high.tolist() == [4, 4, 4, 4]
    assert ranking.mean_rank == pytest.approx([2.5] * 4)


def test_one_model_is_first() -> None:
    ranking = ranked([0], 1)
    assert (ranking.rank[0], ranking.low[0], ranking.high[0]) == (1, 1, 1)


def test_very_few_trials_say_nothing_apart(subtests) -> None:
    for trials, apart in [(1, False), (3, False), (8, True)]:
        with subtests.test(trials=trials):
            ranking = ranked([trials, 0], trials)
            assert ranking.better[0, 1] == apart
            assert ranking.rank.tolist() == ([1, 2] if apart else [1, 1])
            assert (ranking.low[1], ranking.high[0]) == ((2, 1) if apart else (1, 2))


def test_evidence_against_the_order_makes_no_claim() -> None:
    """One figure far ahead and the other a little behind: the mean ranks tie, and so do models."""
    tests = PairTests(z=np.array([9.0]), p_value=np.array([1e-9]), informative=np.array([True]))
    success, indicator = np.array([[0.9, 0.1]]), np.array([[5.0, 6.0]])
    assert not rank_models((success, indicator), tests, tests.p_value).better.any()


def test_tasks_that_say_nothing_take_nothing_from_those_that_do() -> None:
    some = PairTests(z=np.array([3.0]), p_value=np.array([0.003]), informative=np.array([True]))
    none = PairTests(z=np.array([0.0]), p_value=np.array([1.0]), informative=np.array([False]))
    assert combined([some, none, none]).z[0] == pytest.approx(3.0)
    assert combined([none, none]).p_value[0] == 1.0


def test_a_family_is_adjusted_by_holm_over_all_its_tests() -> None:
    first, second = (
        PairTests(z=np.zeros(2), p_value=np.array(p), informative=np.ones(2, bool))
        for p in ([0.01, 0.5], [0.001, 0.04])
    )
    assert [list(p) for p in adjusted([first, second])] == [
        pytest.approx([0.03, 0.5]),
        pytest.approx([0.004, 0.08]),
    ]
    assert adjusted([]) == []
