"""Scores beside the expert's: on a scale that nobody else on a board can move."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from buildarena_benchmark import builtin_tasks, references
from buildarena_benchmark.leaderboard import EndedJob, summarise
from buildarena_benchmark.statistics import expert_scores


def test_each_point_stands_for_about_twice_as_much(subtests) -> None:
    for times, score in [(0, 0), (1, 1), (3, 2), (7, 3), (-2, 0)]:
        with subtests.test(times=times):
            assert expert_scores(np.array([times * 40.0]), 40.0) == pytest.approx([score])


@given(st.lists(st.floats(0, 1e6), min_size=2), st.floats(1e-3, 1e6))
def test_more_is_never_worth_less(indicators, reference) -> None:
    scores = expert_scores(np.sort(indicators), reference)
    assert (np.diff(scores) >= 0).all()


def trial(number: int, task: str, indicator: float, *, success: bool = True) -> EndedJob:
    return EndedJob(
        job_id=f"job_{number}",
        task=task,
        model="m",
        outcome="success" if success else "unsuccessful",
        success=success,
        indicator=indicator,
    )


def test_the_expert_scores_one_and_a_failure_nothing(subtests) -> None:
    for task in builtin_tasks():
        with subtests.test(task=task):
            expert = references()[task]
            cell = summarise([trial(number, task, expert) for number in range(12)])
            assert cell.score == pytest.approx(1)
            assert cell.score_low is not None
            assert cell.score_low < 1 <= cell.score_high
            failed = [trial(number, task, 100 * expert, success=False) for number in range(12, 24)]
            both = summarise([*(trial(number, task, expert) for number in range(12)), *failed])
            assert both.score == pytest.approx(0.5)


def test_a_task_without_an_expert_has_no_score() -> None:
    cell = summarise([trial(number, "custom", 3.0) for number in range(12)])
    assert (cell.score, cell.score_low, cell.score_high) == (None, None, None)
    assert cell.indicator_mean == 3.0


def test_one_lucky_trial_carries_a_mean_of_indicators_but_no_score() -> None:
    (task, expert) = next(iter(references().items()))
    steady = summarise([trial(number, task, expert) for number in range(20)])
    lucky = [trial(0, task, 30 * expert), *(trial(n, task, 0.1 * expert) for n in range(1, 20))]
    found = summarise(lucky)
    assert found.indicator_mean > steady.indicator_mean
    assert found.score < steady.score
