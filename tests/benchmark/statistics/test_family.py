"""What a board claims of models that are alike, and of models that are not."""

import numpy as np
import pytest
from support.boards.made_up_trials import LOADS, board, rankings

MODELS, TASKS = 12, 9


def boards(seed: int, count: int, rates, sizes, loads):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield rankings(board(rng, rates, sizes, [LOADS[loads]] * MODELS))


@pytest.mark.ci
def test_of_models_alike_none_is_called_better(subtests) -> None:
    """Testing each pair for itself, some model is called better on 77 % of such boards."""
    for rate, size, loads in [
        (0.3, 64, "lognormal, sigma 0.8"),
        (0.9, 64, "censored at 1500"),
        (0.1, 64, "near constant"),
        (0.6, 16, "lognormal, sigma 1.2"),
    ]:
        with subtests.test(rate=rate):
            rates = np.full((TASKS, MODELS), rate)
            found = boards(31, 40, rates, [size] * MODELS, loads)
            wrong = sum(any(ranking.better.any() for ranking in made) for made in found)
            # At 5 % a board, six of forty or more are wrong in 1 of 70 trials.
            assert wrong < 6


def test_models_with_unequal_numbers_of_trials_are_not_called_better() -> None:
    sizes = [4, 8, 16, 64] * 3
    found = boards(32, 30, np.full((TASKS, MODELS), 0.3), sizes, "lognormal, sigma 0.8")
    assert sum(any(ranking.better.any() for ranking in made) for made in found) < 5


def test_a_model_that_is_better_is_found() -> None:
    """Twice as often successful everywhere: found overall, on many tasks, and against all."""
    rates = np.full((TASKS, MODELS), 0.3)
    rates[:, 0] = 0.6
    overall = tasks = 0.0
    for made in boards(33, 10, rates, [64] * MODELS, "lognormal, sigma 0.8"):
        overall += made[-1].better[0, 1:].mean() / 10
        tasks += np.mean([ranking.better[0, 1:].mean() for ranking in made[:-1]]) / 10
        assert not any(ranking.better[1:, 0].any() for ranking in made)
    assert overall == pytest.approx(1.0)
    assert tasks > 0.1


def test_a_lead_on_one_task_does_not_outweigh_being_behind_on_the_others() -> None:
    rates = np.full((TASKS, MODELS), 0.35)
    rates[:, 0] = 0.25
    rates[0, :2] = 1.0, 0.0
    for made in boards(34, 10, rates, [256] * MODELS, "near constant"):
        assert not made[-1].better[0, 1]


def test_places_hold_every_true_place() -> None:
    rates = np.tile(np.linspace(0.1, 0.65, MODELS), (TASKS, 1))
    for made in boards(35, 10, rates, [64] * MODELS, "near constant"):
        for ranking in made:
            true = np.arange(MODELS, 0, -1)
            assert np.all((ranking.low <= true) & (true <= ranking.high))
