"""The family `budget`: what is no light bridge, and bridges that are, also beside the expert's."""

import pytest
from support.machines.headroom import drafted, propped_beam
from support.machines.light_bridges import hanging_post, row, three_pieces, with_ballast
from support.machines.people.bridges import beam
from support.machines.trials import trial

from buildarena_benchmark import TaskError, load_task
from buildarena_benchmark.tasks import loading
from buildarena_worker.builtin.designs import DESIGNS
from buildarena_worker.builtin.designs.drafting import DOWN

LOAD = 300.0


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("seed", [0, 1])
def test_the_expert_leaves_room_above_it(engine, tasks, seed) -> None:
    machine = drafted(DESIGNS["budget-1"](seed), [])
    result, _ = trial(tasks["budget-1"], machine, engine)
    assert result.success, result
    assert result.flags == ()
    assert result.indicator == pytest.approx(LOAD / machine.mass, abs=1e-5)


@pytest.mark.nightly(keep=2)
@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize(
    ("columns", "height"), [((0,), 5), ((-2, 2), 5), ((-1, 0, 1), 5), ((-3, 3), 5)]
)
def test_what_the_gaps_floor_bears_is_not_carried_by_a_light_bridge(
    engine, tasks, columns, height
) -> None:
    machine = row(columns=columns, height=height).machine
    result, path = trial(tasks["budget-1"], machine, engine)
    assert path.bearing.ground.max() > 10.0, "the floor bears some of it"
    assert (result.success, result.indicator) == (False, 0.0)


@pytest.mark.nightly(keep=2)
@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize(("columns", "height"), [((0,), 4), ((-2, 2), 4), ((-1, 1), 3), ((), 0)])
def test_a_bridge_that_gives_way_earns_nothing_by_its_debris(
    engine, tasks, columns, height
) -> None:
    machine = row(columns=columns, height=height).machine
    result, _ = trial(tasks["budget-1"], machine, engine)
    assert (result.success, result.indicator) == (False, 0.0)


@pytest.mark.nightly(keep=1)
@pytest.mark.nightly(engine="pybullet")
@pytest.mark.parametrize(
    "machine",
    [
        hanging_post(1),
        row(6).machine,
        row(braces=[(-5, 5, DOWN)]).machine,
        row(braces=[(-5, 0, DOWN), (0, 5, DOWN), (-3, 3, DOWN)]).machine,
    ],
    ids=["a short post", "a bare row", "one long brace", "three braces"],
)
def test_a_part_of_the_load_is_worth_nothing(engine, tasks, machine) -> None:
    """Though its load over its mass is above the expert's."""
    result, _ = trial(tasks["budget-1"], machine, engine)
    assert 20.0 < result.metrics["load_when_decided"] < LOAD
    assert (result.success, result.indicator) == (False, 0.0)


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
def test_a_bridge_that_bears_the_load_for_a_moment_does_not_carry_it(engine, tasks) -> None:
    task, machine = tasks["budget-1"], hanging_post(1)
    result, _ = trial(task, machine, engine)
    bears = result.metrics["load_when_decided"]
    for more in (0.0, 5.0):
        cargo = task.scenario.cargo.model_copy(update={"final_mass": bears + more})
        result, path = trial(task, machine, engine, cargo=cargo)
        assert path.breaks, "it gives way while it holds what it bore a moment"
        assert (result.success, result.indicator) == (False, 0.0)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(
    "machine",
    [
        beam(10),
        hanging_post(2, half=6),
        three_pieces(1),
        three_pieces(2),
        propped_beam(10, (), foot=0),
    ],
    ids=["a braced beam", "a hanging post", "three pieces", "a longer post", "braced on top"],
)
def test_an_honest_bridge_is_worth_its_load_over_its_mass(engine, tasks, machine) -> None:
    result, _ = trial(tasks["budget-1"], machine, engine)
    assert result.success, result
    assert result.flags == ()
    assert result.indicator == pytest.approx(LOAD / machine.mass, abs=1e-5)


@pytest.mark.nightly(engine="pybullet")
def test_more_strength_earns_nothing_and_more_mass_costs(engine, tasks) -> None:
    lean, heavy = drafted(DESIGNS["budget-1"](0), []), with_ballast()
    worth = [trial(tasks["budget-1"], machine, engine)[0].indicator for machine in (lean, heavy)]
    assert heavy.mass > 1.5 * lean.mass
    assert worth[1] == pytest.approx(worth[0] * lean.mass / heavy.mass, rel=1e-4)


def test_a_load_that_is_whole_only_after_the_trial_is_refused() -> None:
    folder = loading.resources.files("buildarena_benchmark.tasks") / "catalogue"
    text = (folder / "budget-1.yaml").read_text(encoding="utf-8")
    with pytest.raises(TaskError, match="the cargo weighs its 300 only when the trial has ended"):
        load_task(text.replace("ramp_s: 8", "ramp_s: 11.5"))
