"""Bridges: which carries more, whichever way they stand, and how a cargo rests on them."""

from collections.abc import Sequence

import pytest
from benchmarks.agreement import compared
from support.machines.building import KeyedDraft
from support.machines.random_machines import TASKS
from support.machines.references import load_machine
from support.machines.trials import gap_terrain, trial
from support.marks import nightly

from buildarena_benchmark.experts.drafting import NORTH, SOUTH, UP
from buildarena_geometry import Machine
from buildarena_simulation import simulate
from buildarena_simulation.scenario import SpanPlacement


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
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


def _beam_with(braces: Sequence[tuple[int, int]], length: int = 7) -> Machine:
    draft = KeyedDraft()
    middle = draft.start()
    ahead = draft.row(middle, NORTH, length // 2)
    row = [*reversed(draft.row(middle, SOUTH, length // 2)), middle, *ahead]
    for first, second in braces:
        draft.connect(row[first], row[second], UP)
    return draft.machine


@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize("spans", [((0, 3), (3, 6)), nightly(((0, 6), (0, 5), (1, 6), (1, 5)))])
def test_braces_stacked_on_the_same_faces_are_worth_one(engine, tasks, spans) -> None:
    once, often = (trial(tasks["support-1"], _beam_with(spans * n), engine)[0] for n in (1, 5))
    assert often.indicator <= max(1.05 * once.indicator, 1.0)
    first = "load_at_first_break"
    assert often.metrics[first] <= 1.02 * once.metrics[first]


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(
    "task", [nightly(task) if task in {"transport-2", "transport-3"} else task for task in TASKS]
)
def test_engines_agree_on_machines_that_nobody_chose(task) -> None:
    result = compared("basic", task, seed=5)
    assert result.same
    assert result.close
