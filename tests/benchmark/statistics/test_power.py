"""What a board can show, said before it is paid for."""

import numpy as np
from support.boards.made_up_trials import LOADS, board, rankings

from buildarena_benchmark.statistics import board_power, detectable_difference

ALIKE = LOADS["near constant"]


def claimed(rise: float, *, models: int, tasks: int, trials: int, boards: int) -> float:
    """Share of boards on which a model that is better by so much is called better than a second."""
    rng = np.random.default_rng(5)
    rates = np.full((tasks, models), 0.5)
    rates[:, 0] += rise
    made = (rankings(board(rng, rates, [trials] * models, [ALIKE] * models)) for _ in range(boards))
    return float(np.mean([ranked[-1].better[0, 1] for ranked in made]))


def test_boards_claim_what_was_said_and_hardly_half_of_it() -> None:
    sizes = {"models": 3, "tasks": 3, "trials": 24}
    rise = board_power(**sizes).overall
    assert claimed(rise, **sizes, boards=50) >= 0.6
    assert claimed(rise / 2, **sizes, boards=50) <= 0.3


def test_more_claims_need_more_on_each_task(subtests) -> None:
    for more in ["models", "tasks"]:
        with subtests.test(more=more):
            few = {"models": 3, "tasks": 3, "trials": 64}
            many = {**few, more: 12}
            assert board_power(**many).on_a_task > board_power(**few).on_a_task


def test_more_tasks_and_more_trials_show_smaller_differences() -> None:
    few = board_power(models=3, tasks=3, trials=64)
    assert board_power(models=3, tasks=9, trials=64).overall < few.overall
    assert board_power(models=3, tasks=3, trials=128).on_a_task < few.on_a_task


def test_a_pair_on_one_task_is_one_claim() -> None:
    power = board_power(models=2, tasks=1, trials=64)
    assert power.on_a_task == power.overall == detectable_difference(0.5, 64)
    assert power == board_power(models=1, tasks=1, trials=64)


def test_as_many_trials_as_said_show_ten_points() -> None:
    needed = board_power(models=12, tasks=9, trials=8).trials_for_ten_points
    assert needed == 127
    assert board_power(models=12, tasks=9, trials=needed).overall <= 0.1
    assert board_power(models=12, tasks=9, trials=needed - 1).overall > 0.1


def test_too_few_trials_claim_nothing_on_a_task() -> None:
    assert board_power(models=12, tasks=9, trials=8).on_a_task is None
