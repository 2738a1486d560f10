"""Bridges: which carries more, and which does not count."""

import itertools

import pytest
from tests.simulation.designs import (
    EAST,
    Actions,
    beam,
    deck,
    one_shot_bridge,
    replayed,
)

from buildarena_benchmark import Score, Task, score
from buildarena_simulation import Trajectory, simulate


def _trial(task: Task, actions: Actions, engine: str) -> tuple[Score, Trajectory]:
    machine = replayed(actions)
    trajectory = simulate(machine, task.scenario, engine)
    return score(task, machine, trajectory), trajectory


def test_more_bracing_carries_more(engine: str, tasks: dict[str, Task]) -> None:
    beams = [beam(7, braces) for braces in ("", "t", "tb", "12")]
    loads = [_trial(tasks["support-1"], actions, engine)[0].indicator for actions in beams]
    assert loads == sorted(loads)
    assert all(b > 1.2 * a for a, b in itertools.pairwise(loads))


def test_a_braced_deck_carries_more_than_a_bare_one(engine: str, tasks: dict[str, Task]) -> None:
    bare, _ = _trial(tasks["support-1"], deck(5, 7), engine)
    braced, trajectory = _trial(tasks["support-1"], deck(5, 7, cross=True), engine)
    assert braced.indicator > bare.indicator
    heavier = braced.metrics["load_at_first_break"], bare.metrics["load_at_first_break"]
    assert heavier[0] > 1.1 * heavier[1]
    assert min(event.time_s for event in trajectory.breaks) > 5.0  # not while the cargo is light


def test_the_one_shot_bridge_carries_what_the_paper_reports_but_stands_in_the_gap(
    engine: str, tasks: dict[str, Task]
) -> None:
    result, trajectory = _trial(tasks["support-1"], one_shot_bridge(), engine)
    assert result.metrics["load_when_decided"] >= 900.0
    # The landing does not break it.
    assert all((event.cargo_mass or 0.0) > 900.0 for event in trajectory.breaks)
    assert (result.success, result.indicator) == (False, 0.0)
    assert result.flags == ("does_not_span",)
    assert result.metrics["floor_share"] > 0.5  # its pillars reach the gap's floor


def test_a_beam_that_is_too_short_for_the_gap_scores_nothing(
    engine: str, tasks: dict[str, Task]
) -> None:
    result, _ = _trial(tasks["support-1"], beam(5), engine)
    assert not result.success
    assert result.indicator == 0.0


def test_a_bridge_built_along_the_gap_is_turned_across_it(
    engine: str, tasks: dict[str, Task]
) -> None:
    along = _trial(tasks["support-1"], beam(7, direction=EAST), engine)[0]
    across = _trial(tasks["support-1"], beam(7), engine)[0]
    assert along.success
    assert along.indicator == pytest.approx(across.indicator, rel=0.1)
