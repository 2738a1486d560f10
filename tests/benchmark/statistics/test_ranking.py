from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import fisher_exact, rankdata

from buildarena_benchmark.statistics import mean_ranks, rank_models
from buildarena_benchmark.statistics.ranking import descending_ranks, smallest_p_value

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


def resampled(success: np.ndarray, trials: int, seed: int, replicates: int = 400) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.binomial(trials, success, size=(replicates, *success.shape)) / trials


def test_models_that_cannot_be_told_apart_share_a_rank() -> None:
    success = np.array([[0.80, 0.52, 0.50, 0.10]] * 5)
    replicates = resampled(success, 64, seed=11)
    ranking = rank_models((success, success), (replicates, replicates), np.full((5, 4), 64))
    assert ranking.rank.tolist() == [1, 2, 2, 4]
    assert ranking.low.tolist() == [1, 2, 2, 4]
    assert ranking.high.tolist() == [1, 3, 3, 4]
    assert not ranking.better.diagonal().any()


def test_equal_models_all_share_the_first_rank() -> None:
    same = np.full((3, 4), 0.5)
    ranking = rank_models((same, same), (np.stack([same] * 10),) * 2, np.full((3, 4), 64))
    assert ranking.rank.tolist() == [1, 1, 1, 1]
    assert ranking.mean_rank == pytest.approx([2.5] * 4)


def test_one_model_is_first() -> None:
    one = np.array([[0.0]])
    ranking = rank_models((one, one), (one[None], one[None]), np.array([[1]]))
    assert (ranking.rank[0], ranking.low[0], ranking.high[0]) == (1, 1, 1)


def test_equal_models_are_seldom_told_apart() -> None:
    """Of two models that are alike, one is called better in about 5 % of benchmarks."""
    rng = np.random.default_rng(12)
    wrong = 0
    for number in range(400):
        success = rng.binomial(64, 0.4, size=(9, 2)) / 64
        replicates = resampled(success, 64, seed=number)
        wrong += rank_models(
            (success, success), (replicates, replicates), np.full((9, 2), 64)
        ).better.any()
    assert wrong / 400 <= 0.07


@pytest.mark.parametrize(("trials", "apart"), [(1, False), (3, False), (4, True)])
def test_very_few_trials_say_nothing_apart(trials, apart) -> None:
    success = np.array([[1.0, 0.0]])
    never_varies = np.repeat(success[None], 50, axis=0)
    counts = np.full((1, 2), trials)
    ranking = rank_models((success, success), (never_varies, never_varies), counts)
    assert ranking.better[0, 1] == apart
    assert ranking.rank.tolist() == ([1, 2] if apart else [1, 1])
    assert (ranking.low[1], ranking.high[0]) == ((2, 1) if apart else (1, 2))


def test_the_smallest_p_value_is_that_of_fishers_test_of_full_separation() -> None:
    for n in (1, 2, 5, 20):
        table = [[n, 0], [0, n]]
        expected = min(1.0, fisher_exact(table).pvalue)
        assert smallest_p_value(np.full((1, 2), n))[0, 1] == pytest.approx(expected)
