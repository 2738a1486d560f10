"""Ranks, what a board claims of models alike and unlike, and scores relative to the expert's."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import rankdata
from support.boards.made_up_trials import LOADS, board, rankings

from buildarena_benchmark import builtin_tasks, references
from buildarena_benchmark.leaderboard import EndedJob, summarise
from buildarena_benchmark.statistics import board_power, mean_ranks
from buildarena_benchmark.statistics.means import expert_scores
from buildarena_benchmark.statistics.permutation import PairTests, Sample, pair_tests
from buildarena_benchmark.statistics.power import detectable_difference
from buildarena_benchmark.statistics.ranking import adjusted, combined, fitted_ranks, rank_models

TABLES = arrays(float, (4, 5), elements=st.sampled_from([0.0, 0.1, 0.25, 0.5, 1.0]))
MODELS, TASKS = 12, 9


@given(TABLES, TABLES)
def test_mean_ranks_are_scipys(success, indicator) -> None:
    theirs = [rankdata(-table, method="average", axis=1) for table in (success, indicator)]
    assert mean_ranks(success, indicator) == pytest.approx(np.mean(np.vstack(theirs), axis=0))


@given(TABLES, TABLES)
def test_the_fit_of_a_full_board_is_its_mean_ranks(success, indicator) -> None:
    assert fitted_ranks(success, indicator) == pytest.approx(mean_ranks(success, indicator))


def test_the_fit_allows_for_the_models_that_were_met() -> None:
    """On the second task the third model beat only the weakest, by as much as the first did."""
    gap = np.nan
    success = np.array([[0.9, 0.5, gap], [gap, 0.5, 0.9], [0.9, gap, 0.9]])
    first, second, third = fitted_ranks(success, success)
    assert first == pytest.approx(third)
    assert first < second


def ranked(successes: list[int], trials: int, tasks: int = 1):
    """Models by their successes, which are all worth the same."""
    won = [(np.arange(trials) < count).astype(float) for count in successes]
    row = [Sample.of(np.column_stack([w, w])) for w in won]
    tests = combined([pair_tests(list(combinations(row, 2)))] * tasks)
    rates = np.array([[count / trials for count in successes]] * tasks)
    return rank_models((rates, rates), tests, adjusted([tests])[0])


def test_models_that_cannot_be_told_apart_share_a_rank() -> None:
    for successes, trials, tasks, ranks, high in (
        ([51, 33, 32, 6], 64, 5, [1, 2, 2, 4], [1, 3, 3, 4]),
        ([32, 32, 32, 32], 64, 3, [1, 1, 1, 1], [4, 4, 4, 4]),
        ([0], 1, 1, [1], [1]),
        ([3, 0], 3, 1, [1, 1], [2, 2]),  # too few trials to say so
        ([8, 0], 8, 1, [1, 2], [1, 2]),
    ):
        ranking = ranked(successes, trials, tasks)
        assert [ranking.rank.tolist(), ranking.high.tolist()] == [ranks, high]
        assert not ranking.better.diagonal().any()


def pair_of(z: list[float], p_value: list[float], *, informative: bool = True) -> PairTests:
    told = np.full(len(z), informative)
    return PairTests(z=np.array(z), p_value=np.array(p_value), informative=told)


def test_evidence_against_the_order_makes_no_claim() -> None:
    """One figure far ahead and the other a little behind: the mean ranks tie, and so do models."""
    tests = pair_of([9.0], [1e-9])
    success, indicator = np.array([[0.9, 0.1]]), np.array([[5.0, 6.0]])
    assert not rank_models((success, indicator), tests, tests.p_value).better.any()


def test_tasks_that_say_nothing_take_nothing_from_those_that_do() -> None:
    some, none = pair_of([3.0], [0.003]), pair_of([0.0], [1.0], informative=False)
    assert combined([some, none, none]).z[0] == pytest.approx(3.0)
    assert combined([none, none]).p_value[0] == 1.0


def test_a_family_is_adjusted_by_holm_over_all_its_tests() -> None:
    first, second = pair_of([0, 0], [0.01, 0.5]), pair_of([0, 0], [0.001, 0.04])
    one, other = (p.tolist() for p in adjusted([first, second]))
    assert (one, other) == (pytest.approx([0.03, 0.5]), pytest.approx([0.004, 0.08]))
    assert adjusted([]) == []


# What boards claim


def boards(seed: int, count: int, rates, sizes, loads):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield rankings(board(rng, rates, sizes, [LOADS[loads]] * len(sizes)))


@pytest.mark.ci
def test_of_models_alike_none_is_called_better(subtests) -> None:
    """Testing each pair for itself, some model is called better on 77 % of such boards."""
    for rate, size, loads in (
        (0.3, 64, "lognormal, sigma 0.8"),
        (0.9, 64, "censored at 1500"),
        (0.1, 64, "near constant"),
        (0.6, 16, "lognormal, sigma 1.2"),
    ):
        with subtests.test(rate=rate):
            found = boards(31, 40, np.full((TASKS, MODELS), rate), [size] * MODELS, loads)
            wrong = sum(any(ranking.better.any() for ranking in made) for made in found)
            # At 5 % a board, six of forty or more are wrong in 1 of 70 trials.
            assert wrong < 6


def test_models_with_unequal_numbers_of_trials_are_not_called_better() -> None:
    rates, sizes = np.full((TASKS, MODELS), 0.3), [4, 8, 16, 64] * 3
    found = boards(32, 30, rates, sizes, "lognormal, sigma 0.8")
    assert sum(any(ranking.better.any() for ranking in made) for made in found) < 5


def test_a_model_that_is_better_is_found() -> None:
    """Twice as often successful everywhere: found overall, on many tasks, and against all."""
    rates = np.full((TASKS, MODELS), 0.3)
    rates[:, 0] = 0.6
    tasks = 0.0
    for made in boards(33, 5, rates, [64] * MODELS, "lognormal, sigma 0.8"):
        assert made[-1].better[0, 1:].all()
        tasks += np.mean([ranking.better[0, 1:].mean() for ranking in made[:-1]]) / 5
        assert not any(ranking.better[1:, 0].any() for ranking in made)
    assert tasks > 0.1


def test_a_lead_on_one_task_does_not_outweigh_being_behind_on_the_others() -> None:
    rates = np.full((TASKS, MODELS), 0.35)
    rates[:, 0] = 0.25
    rates[0, :2] = 1.0, 0.0
    for made in boards(34, 4, rates, [256] * MODELS, "near constant"):
        assert not made[-1].better[0, 1]


def test_places_hold_every_true_place() -> None:
    rates, true = np.tile(np.linspace(0.1, 0.65, MODELS), (TASKS, 1)), np.arange(MODELS, 0, -1)
    for made in boards(35, 5, rates, [64] * MODELS, "near constant"):
        for ranking in made:
            assert np.all((ranking.rank <= true) & (true <= ranking.high))


def test_boards_claim_what_was_said_and_hardly_half_of_it() -> None:
    power = board_power(models=3, tasks=3, trials=24)
    for share, least, most in ((1.0, 0.6, 1.0), (0.5, 0.0, 0.3)):
        rates = np.full((3, 3), 0.5)
        rates[:, 0] += share * power.overall
        made = boards(5, 50, rates, [24] * 3, "near constant")
        assert least <= np.mean([ranked[-1].better[0, 1] for ranked in made]) <= most


def test_more_claims_need_more_and_more_trials_show_more() -> None:
    few = {"models": 3, "tasks": 3, "trials": 64}
    power = board_power(**few)

    def effect(**changes: int) -> float:
        found = board_power(**{**few, **changes}).min_detectable_effect_per_task
        assert found is not None
        return found

    for more in ("models", "tasks"):
        assert effect(**{more: 12}) > effect()
    assert board_power(**{**few, "tasks": 9}).overall < power.overall
    assert effect(trials=128) < effect()
    pair = board_power(models=2, tasks=1, trials=64)
    assert pair.min_detectable_effect_per_task == pair.overall == detectable_difference(0.5, 64)


def test_as_many_trials_as_said_show_ten_points() -> None:
    few = board_power(models=12, tasks=9, trials=8)
    assert (few.samples_for_10pp_effect, few.min_detectable_effect_per_task) == (127, None)
    assert board_power(models=12, tasks=9, trials=127).overall <= 0.1
    assert board_power(models=12, tasks=9, trials=126).overall > 0.1


# Beside the expert's


@given(st.lists(st.floats(0, 1e6), min_size=2), st.floats(1e-3, 1e6))
def test_each_point_stands_for_twice_as_much_and_more_is_never_worth_less(values, expert) -> None:
    assert (np.diff(expert_scores(np.sort(values), expert)) >= 0).all()
    times = np.array([0, 1, 3, 7, -2])
    assert expert_scores(times * expert, expert) == pytest.approx([0, 1, 2, 3, 0])


def made(task: str, *indicators: float, success: bool = True) -> list[EndedJob]:
    usual = {"task": task, "model": "m", "success": success}
    usual["outcome"] = "success" if success else "unsuccessful"
    ids = [f"{success} {number}" for number in range(len(indicators))]
    return [EndedJob(job_id=i, indicator=n, **usual) for i, n in zip(ids, indicators, strict=True)]


def test_the_expert_scores_one_and_a_failure_nothing() -> None:
    for task in builtin_tasks():
        expert = references()[task]
        cell = summarise(made(task, *[expert] * 12))
        assert cell.score == pytest.approx(1), task
        assert cell.score_low < 1 <= cell.score_high
        failed = made(task, *[100 * expert] * 12, success=False)
        assert summarise([*made(task, *[expert] * 12), *failed]).score == pytest.approx(0.5)
    own = summarise(made("custom", *[3.0] * 12))
    assert (own.score, own.score_low, own.score_high, own.indicator_mean) == (None, None, None, 3)
