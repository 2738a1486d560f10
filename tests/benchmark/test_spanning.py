"""Support: the load must go to both terrains. Trajectories made by hand."""

from collections.abc import Callable

import numpy as np
import pytest
from support.machines.building import connect
from support.machines.families import beam
from tests.benchmark.conftest import make_trajectory, with_bearing, with_pieces

from buildarena_benchmark import score
from buildarena_benchmark.scorers.measures.spanning import terrain_sides
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory
from buildarena_simulation.constants import GRAVITY

Series = np.ndarray


def _mass(t: Series) -> Series:
    return 5 + 1495 * np.clip((t - 0.5) / 15, 0.005, 1)


def _carried(
    machine: Machine,
    *,
    fall_at: float | None = None,
    north: Callable[[Series], Series] = np.zeros_like,
) -> Trajectory:
    """A cargo that is released at 9, lands at 6.75, and falls freely from a time on."""

    def path(t: Series) -> Series:
        height = np.maximum(9.0 - GRAVITY / 2 * t**2, 6.75)
        if fall_at is not None:
            height -= GRAVITY / 2 * np.maximum(t - fall_at, 0.0) ** 2
        return np.column_stack([np.zeros_like(t), north(t), np.maximum(height, 0.75)])

    return make_trajectory(machine, 17.0, cargo=path, cargo_mass=_mass)


def _shared(
    trajectory: Trajectory,
    *,
    floor: float | Series = 0.0,
    south: float | Series = 0.5,
    dead: tuple[float, float, float] = (0.0, 0.0, 0.0),
    held: float = 1.0,
    until: float = np.inf,
) -> Trajectory:
    """What the machine bears goes to floor and terrains by shares, besides dead weights on each."""
    t, mass = trajectory.time_s, trajectory.cargo_mass
    assert mass is not None
    load = np.where((t > 0.4) & (t <= until), held * mass, 0.0)
    return with_bearing(
        trajectory,
        ground=floor * load + dead[0],
        south=south * load + dead[1],
        north=(1.0 - floor - south) * load + dead[2],
        cargo=load,
    )


def test_a_bridge_on_both_terrains_spans(tasks, car) -> None:
    result = score(tasks["support-1"], car, _shared(_carried(car)))
    assert (result.success, result.indicator, result.flags) == (True, 1500.0, ("never_fell",))
    assert result.metrics["floor_share"] == pytest.approx(0.0, abs=1e-6)
    assert result.metrics["carried_share"] == pytest.approx(1.0, abs=0.02)


def test_a_bridge_that_breaks_spans_until_then(tasks, car) -> None:
    trial = _shared(_carried(car, fall_at=6.0), until=6.0)
    result = score(tasks["support-1"], car, trial)
    assert result.success
    assert result.flags == ()
    fell = 6.0 + np.sqrt(2 * 2.75 / GRAVITY)
    assert result.indicator == pytest.approx(float(_mass(np.array([fell]))[0]), abs=4.1)


@pytest.mark.parametrize(
    "shares",
    [
        {"floor": 1.0, "south": 0.0},  # a tower
        {"floor": 0.5, "south": 0.25},  # pillars
        {"floor": 0.12, "south": 0.44},
        {"floor": 0.0, "south": 1.0},  # one side only
        {"floor": 0.0, "south": 0.0},
        {"floor": 0.09, "south": 0.90},  # the other side bears hardly more than nothing
        # Dead weight besides: of a tower's companion that lies on the terrains, or of one side's.
        {"floor": 1.0, "south": 0.0, "dead": (0.0, 4000.0, 4000.0)},
        {"floor": 0.0, "south": 1.0, "dead": (0.0, 0.0, 100.0)},
        {"floor": 0.5, "south": 0.25, "dead": (0.0, 4000.0, 4000.0)},
        {"floor": 0.0, "south": 0.06, "dead": (0.0, 0.0, 9000.0)},
        # Something else holds the cargo: a wall, or a terrain's edge.
        {"held": 0.5},
        {"held": 0.0},
    ],
)
def test_a_load_that_goes_elsewhere_does_not_count(tasks, car, shares) -> None:
    result = score(tasks["support-1"], car, _shared(_carried(car), **shares))
    assert (result.success, result.indicator) == (False, 0.0)
    assert result.flags == ("does_not_span",)


@pytest.mark.parametrize(
    "shares",
    [
        {"floor": 0.09, "south": 0.45},  # it scrapes the floor
        {"south": 0.2},  # it rests unevenly
        {"dead": (0.0, 30.0, 300.0)},  # a heavy end
    ],
)
def test_an_odd_bridge_may_span(tasks, car, shares) -> None:
    assert score(tasks["support-1"], car, _shared(_carried(car), **shares)).success


@pytest.mark.parametrize(("sinks_at", "spans"), [(8.0, False), (12.0, False), (15.3, True)])
def test_a_bridge_that_sinks_onto_a_tower(tasks, car, sinks_at, spans) -> None:
    trial = _carried(car)
    floor = np.where(trial.time_s > sinks_at, 1.0, 0.0)
    short = _carried(car, fall_at=15.6)
    task = tasks["support-1"]
    until = 15.6 if spans else np.inf
    sunk = _shared(short if spans else trial, floor=floor, south=(1 - floor) / 2, until=until)
    assert score(task, car, sunk).success == spans


def test_a_cargo_that_slides_onto_a_terrain_is_no_longer_carried(tasks, car) -> None:
    trial = _carried(car, north=lambda t: np.maximum(t - 4.0, 0.0))
    result = score(tasks["support-1"], car, _shared(trial))
    assert result.success
    assert result.indicator == pytest.approx(float(_mass(np.array([5.04]))[0]), abs=4.1)
    assert "never_fell" not in result.flags
    wide = score(tasks["support-2"], car, _shared(trial))  # a wider gap allows more
    assert wide.indicator == pytest.approx(float(_mass(np.array([5.28]))[0]), abs=4.1)


@pytest.mark.parametrize(
    ("name", "most"), [("support-1", 1.0), ("support-2", 1.25), ("support-3", 2.5)]
)
@pytest.mark.parametrize("way", [1, -1])
def test_a_cargo_stays_near_the_middle(tasks, car, name, most, way) -> None:
    for aside, success in ((0.95 * most, True), (1.05 * most, False)):
        trial = _carried(car, north=lambda t, far=aside: way * np.clip(t - 1.0, 0.0, far))
        result = score(tasks[name], car, _shared(trial))
        assert ("never_fell" in result.flags) == success
        assert (result.indicator == 1500.0) == success


def test_a_cargo_that_slides_off_at_once_was_not_carried(tasks, car) -> None:
    slid = _carried(car, north=lambda t: -np.maximum(t - 0.5, 0.0) * 3.0)
    for trial in (slid, _shared(slid)):
        result = score(tasks["support-1"], car, trial)
        assert (result.success, result.indicator) == (False, 0.0)
    aside = _carried(car, north=lambda t: np.full_like(t, 9.0))
    assert not score(tasks["support-1"], car, _shared(aside)).success


def test_without_contact_forces_the_rule_is_not_measured(tasks, car) -> None:
    result = score(tasks["support-1"], car, _carried(car))
    assert result.success
    assert result.flags == ("never_fell", "span_not_measured")
    assert result.metrics["floor_share"] is None


def test_islands_in_the_gap_and_boxes_behind_belong_to_the_scenario(tasks) -> None:
    content = tasks["support-2"].scenario.model_dump()
    south, north = content["terrain"]
    island = {"center": (0.0, 0.0, 2.0), "size": (4.0, 4.0, 4.0)}
    scenario = Scenario.model_validate(content | {"terrain": [island, north, south]})
    assert terrain_sides(scenario) == ([2], [1])
    one = Scenario.model_validate(content | {"terrain": [south]})
    assert terrain_sides(one) is None
    assert terrain_sides(tasks["transport-1"].scenario) is None


# Bridges that collapse


@pytest.fixture(scope="module")
def bar() -> Machine:
    return beam(7)


def _north_of_the_middle(machine: Machine) -> list[str]:
    return [block.id for block in machine.blocks.values() if block.center[1] > 0.1]


@pytest.mark.parametrize("pieces", ["halves", "an end", "thirds", "bits"])
def test_what_debris_carries_is_a_metric(tasks, bar, pieces) -> None:
    north = _north_of_the_middle(bar)
    south = [block for block in bar.blocks if block not in {"1", *north}]
    groups = {
        "halves": [north],
        "an end": [north[-2:]],
        "thirds": [north, south],
        "bits": [[block] for block in bar.blocks],
    }[pieces]
    trial = with_pieces(_shared(_carried(bar)), *groups, since_s=6.0)
    result = score(tasks["support-1"], bar, trial)
    assert result.success
    assert result.indicator == pytest.approx(float(_mass(np.array([6.0]))[0]), abs=4.1)
    assert result.metrics["load_on_debris"] == 1500.0
    assert result.metrics["collapse_time_s"] == pytest.approx(6.0)
    assert result.flags == ()


def test_a_part_that_breaks_off_a_bridge_is_no_collapse(tasks) -> None:
    bar = beam(9)
    tip = max(bar.blocks.values(), key=lambda block: block.center[1]).id
    trial = with_pieces(_shared(_carried(bar)), [tip], since_s=6.0)
    result = score(tasks["support-1"], bar, trial)
    assert (result.success, result.indicator, result.flags) == (True, 1500.0, ("never_fell",))
    assert result.metrics["load_on_debris"] is None


def test_a_bridge_that_ropes_hold_together_has_not_collapsed(tasks) -> None:
    bar = beam(7)
    ends = _north_of_the_middle(bar)
    assert connect(bar, "1", "E", ends[-1], "D", connector="Winch").ok
    trial = with_pieces(_shared(_carried(bar)), ends, since_s=6.0)
    assert score(tasks["support-1"], bar, trial).indicator == 1500.0


def test_debris_that_holds_from_the_start_is_no_bridge(tasks, bar) -> None:
    ends = _north_of_the_middle(bar)
    trial = with_pieces(_shared(_carried(bar)), ends, since_s=1.0)
    result = score(tasks["support-1"], bar, trial)
    assert (result.success, result.indicator) == (False, 0.0)
