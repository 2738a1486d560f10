"""Bridges: which carries more, and which does not count."""

import itertools
from collections.abc import Sequence

import pytest
from support.machines.drafts import KeyedDraft
from support.machines.families import beam, deck
from support.machines.references import load_machine
from support.machines.trials import trial
from support.marks import nightly

from buildarena_geometry import Machine
from buildarena_simulation import simulate
from buildarena_simulation.scenario import SpanPlacement, gap_terrain
from buildarena_worker.builtin.designs.drafting import BRACE, EAST, NORTH, SOUTH, UP


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
def test_more_bracing_carries_more(engine, tasks) -> None:
    beams = [beam(7, braces) for braces in ("", "t", "tb", "12")]
    loads = [trial(tasks["support-1"], actions, engine)[0].indicator for actions in beams]
    assert loads == sorted(loads)
    assert all(b > 1.2 * a for a, b in itertools.pairwise(loads))


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
def test_a_braced_deck_carries_more_than_a_bare_one(engine, tasks) -> None:
    bare, _ = trial(tasks["support-1"], deck(5, 7), engine)
    braced, trajectory = trial(tasks["support-1"], deck(5, 7, cross=True), engine)
    assert braced.indicator > bare.indicator
    heavier = braced.metrics["load_at_first_break"], bare.metrics["load_at_first_break"]
    assert heavier[0] > 1.05 * heavier[1]
    assert min(event.time_s for event in trajectory.breaks) > 5.0  # not while the cargo is light


@pytest.mark.nightly(keep=1)
def test_the_one_shot_bridge_stands_in_the_gap(engine, tasks) -> None:
    result, _ = trial(tasks["support-1"], load_machine("one-shot-bridge"), engine)
    assert result.metrics["load_when_decided"] >= 900.0
    assert (result.success, result.indicator) == (False, 0.0)
    assert result.flags == ("does_not_span",)
    assert result.metrics["floor_share"] > 0.5  # its pillars reach the gap's floor


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
def test_the_one_shot_bridge_breaks_where_the_paper_reports_its_load(engine, tasks) -> None:
    # Over a gap so deep that its pillars hang free; over the task's they stand on the floor.
    deep = tasks["support-1"].scenario.model_copy(
        update={
            "terrain": gap_terrain(5.0, height=25.0),
            "placement": SpanPlacement(gap=5.0, lowest_center=26.0),
        }
    )
    first = simulate(load_machine("one-shot-bridge"), deep, engine).breaks[0]
    assert first.cargo_mass == pytest.approx(1000.0, rel=0.03)


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
def test_overlap_on_the_terrain_never_hurts(engine, tasks) -> None:
    loads = [
        trial(tasks["support-1"], beam(length, "t"), engine)[0].metrics["load_at_first_break"]
        for length in (7, 11, 25)
    ]
    assert loads == sorted(loads)
    assert loads[-1] < 1.1 * loads[0]


def _beam_with(
    braces: Sequence[tuple[int, int]], length: int = 7, connector: str = BRACE
) -> Machine:
    draft = KeyedDraft()
    middle = draft.start()
    ahead = draft.row(middle, NORTH, length // 2)
    row = [*reversed(draft.row(middle, SOUTH, length // 2)), middle, *ahead]
    for first, second in braces:
        draft.connect(row[first], row[second], UP, connector=connector)
    return draft.machine


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize(
    "spans",
    [
        ((0, 3), (3, 6)),
        nightly(((0, 6),)),
        nightly(((0, 6), (0, 5), (1, 6), (1, 5))),
        nightly(tuple((k, k + 1) for k in range(6))),
    ],
)
def test_connectors_stacked_on_the_same_faces_are_worth_one(engine, tasks, spans) -> None:
    task = tasks["support-1"]
    once, often = (trial(task, _beam_with(spans * n), engine)[0].metrics for n in (1, 5))
    assert often["load_at_first_break"] <= 1.02 * once["load_at_first_break"]
    assert trial(task, _beam_with(spans * 5), engine)[0].indicator < 1000.0


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
def test_winches_stacked_between_the_same_faces_are_one_rope(engine, tasks) -> None:
    spans = ((0, 3), (3, 6), (0, 6))
    loads = [
        trial(tasks["support-1"], _beam_with(spans * n, connector="Winch"), engine)[0].indicator
        for n in (1, 4)
    ]
    assert loads[1] <= 1.05 * loads[0]


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
def test_a_beam_that_is_too_short_for_the_gap_scores_nothing(engine, tasks) -> None:
    result, _ = trial(tasks["support-1"], beam(5), engine)
    assert not result.success
    assert result.indicator == 0.0


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
def test_a_bridge_built_along_the_gap_is_turned_across_it(engine, tasks) -> None:
    along = trial(tasks["support-1"], beam(7, "t", direction=EAST), engine)[0]
    across = trial(tasks["support-1"], beam(7, "t"), engine)[0]
    assert along.success
    assert along.indicator == pytest.approx(across.indicator, rel=0.1)
