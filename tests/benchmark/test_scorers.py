"""Scorers, on trajectories made by hand."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from tests.benchmark.conftest import make_trajectory, wheels_of

from buildarena_benchmark import failed_score, score
from buildarena_benchmark.scorers.measures.outline import extents
from buildarena_geometry import Machine
from buildarena_simulation import Trajectory
from buildarena_simulation.constants import GRAVITY

Path = Callable[[np.ndarray], np.ndarray]


def _columns(*columns: np.ndarray | float, like: np.ndarray) -> np.ndarray:
    return np.stack([np.broadcast_to(c, like.shape) for c in columns], axis=1)


def _upwards(height: Path) -> Path:
    return lambda t: _columns(0.0, 0.0, height(t), like=t)


def _ramp(t: np.ndarray) -> np.ndarray:
    return 5 + 1495 * np.clip((t - 0.5) / 15, 0.005, 1)


# Transport


def _north_east(speed: float) -> Path:
    return lambda t: _columns(speed * t / np.sqrt(2), speed * t / np.sqrt(2), 0.0, like=t)


def test_a_vehicle_that_goes_far_enough_passes(tasks, car) -> None:
    result = score(tasks["transport-1"], car, make_trajectory(car, 30.0, moved=_north_east(1.0)))
    assert result.success
    assert result.indicator == pytest.approx(30.0, abs=1e-3)
    assert result.flags == ("drive_not_measured",)
    metrics = result.metrics
    assert metrics["wheels"] == 4
    assert metrics["intact"] is True
    assert metrics["parts"] == car.part_count
    assert metrics["direction_consistency"] == pytest.approx(1.0, abs=1e-4)
    assert metrics["lateral_deviation"] == pytest.approx(0.0, abs=1e-3)
    assert metrics["path_efficiency"] == pytest.approx(1.0, abs=1e-4)
    assert metrics["backtrack"] == pytest.approx(0.0, abs=1e-4)
    assert metrics["max_speed"] == pytest.approx(1.0, abs=1e-2)


def test_the_distance_must_exceed_ten(tasks, car) -> None:
    short = make_trajectory(car, 10.0, moved=_north_east(0.99))
    assert not score(tasks["transport-1"], car, short).success


def test_the_farthest_point_counts_not_the_last(tasks, car) -> None:
    there_and_back = make_trajectory(
        car, 30.0, moved=lambda t: _columns(0.0, 15 - np.abs(t - 15), 0.0, like=t)
    )
    result = score(tasks["transport-1"], car, there_and_back)
    assert result.success
    assert result.indicator == pytest.approx(15.0, abs=1e-3)
    assert result.metrics["backtrack"] > 0.5
    assert result.metrics["path_efficiency"] < 0.1


def test_a_vehicle_without_wheels_enough_fails(tasks, car) -> None:
    assert car.act("remove_block", {"block_id": wheels_of(car)[0]}).ok
    result = score(tasks["transport-1"], car, make_trajectory(car, 30.0, moved=_north_east(1.0)))
    assert not result.success
    assert result.metrics["wheels"] == 3


def test_a_vehicle_that_nothing_drives_scores_nothing(tasks, car) -> None:
    assert car.act("reset_control_sequence", {}).ok
    rolling = make_trajectory(car, 30.0, moved=_north_east(1.0))
    result = score(tasks["transport-1"], car, rolling)
    assert (result.success, result.indicator) == (False, 0.0)
    driven = make_trajectory(
        car, 30.0, moved=_north_east(1.0), settings={"effective_key_presses": 2}
    )
    assert score(tasks["transport-1"], car, driven).success


def test_success_without_wheels_is_flagged(tasks, engine_machine) -> None:
    pushed = make_trajectory(
        engine_machine,
        30.0,
        cargo=lambda t: _columns(t, 0.0, 2.0, like=t),
        cargo_mass=lambda t: np.full_like(t, 50.0),
        heated=(False, False),
        settings={"effective_key_presses": 1},
    )
    result = score(tasks["transport-2"], engine_machine, pushed)
    assert result.success
    assert result.flags == ("no_wheels", "drive_not_measured")


def test_a_start_too_high_fails_and_is_flagged(tasks, car) -> None:
    high = make_trajectory(
        car, 30.0, moved=lambda t: _columns(t, 0.0, np.maximum(20.0 - 10 * t, 0.0), like=t)
    )
    result = score(tasks["transport-1"], car, high)
    assert not result.success
    assert result.flags == ("start_too_high", "drive_not_measured")


def test_wheels_that_drift_apart_are_not_intact(tasks, car) -> None:
    trajectory = make_trajectory(car, 30.0, moved=_north_east(1.0))
    positions = trajectory.positions.copy()
    wheel = trajectory.block_ids.index(wheels_of(car)[0])
    positions[:, wheel, 0] += np.linspace(0, 2, len(positions))
    broken = replace(trajectory, positions=positions)
    assert score(tasks["transport-1"], car, broken).metrics["intact"] is False


# Support


def _carried(machine: Machine, fall_at: float | None, *, start: float = 10.0) -> Trajectory:
    def height(t: np.ndarray) -> np.ndarray:
        settled = np.maximum(start - GRAVITY / 2 * t**2, 6.75)
        if fall_at is None:
            return settled
        fallen = GRAVITY / 2 * np.maximum(t - fall_at, 0.0) ** 2
        return np.maximum(settled - fallen, 0.8)

    return make_trajectory(machine, 17.0, cargo=_upwards(height), cargo_mass=_ramp)


def test_the_load_is_the_cargos_mass_when_it_sinks(tasks, car) -> None:
    result = score(tasks["support-1"], car, _carried(car, 8.0))
    assert result.success
    below = 8.0 + np.sqrt(2 * 2.75 / GRAVITY)  # from 6.75 to 4
    sample = np.ceil(below * 25) / 25
    assert result.indicator == pytest.approx(float(_ramp(np.array([sample]))[0]), abs=4.1)
    assert result.metrics["fall_time_s"] == pytest.approx(sample, abs=0.05)
    assert result.flags == ("span_not_measured",)


def test_a_cargo_that_never_falls_counts_in_full_and_is_flagged(tasks, car) -> None:
    result = score(tasks["support-1"], car, _carried(car, None))
    assert result.success
    assert result.indicator == 1500.0
    assert result.flags == ("never_fell", "span_not_measured")


def test_a_cargo_that_is_not_up_for_two_seconds_scores_nothing(tasks, car) -> None:
    early = score(tasks["support-1"], car, _carried(car, 1.5))
    assert (early.success, early.indicator) == (False, 0.0)
    later = score(tasks["support-1"], car, _carried(car, 2.1))
    assert later.success


def test_a_cargo_that_starts_too_high_scores_nothing(tasks, car) -> None:
    result = score(tasks["support-1"], car, _carried(car, 8.0, start=20.5))
    assert (result.success, result.indicator) == (False, 0.0)
    assert result.flags == ("start_too_high", "span_not_measured")


# Lift


@pytest.mark.parametrize(
    ("heated", "thrust"), [((True, True), 2 * 13.76), ((True, False), 15.36), ((False, False), 3.2)]
)
def test_thrust_over_weight_counts_heated_and_cold_cannons(
    tasks, engine_machine, heated, thrust
) -> None:
    trajectory = make_trajectory(engine_machine, 10.0, heated=heated)
    result = score(tasks["lift-1"], engine_machine, trajectory)
    assert result.indicator == pytest.approx(thrust / 3.25, rel=1e-6)
    assert result.success == (thrust > 3.25)
    assert result.metrics["heated_cannons"] == sum(heated)


def _climb(machine: Machine, height: Path, **more: object) -> Trajectory:
    return make_trajectory(machine, 30.0, moved=_upwards(height), **more)


def test_a_rocket_that_keeps_rising_passes(tasks, engine_machine) -> None:
    rising = _climb(engine_machine, lambda t: np.maximum(t - 2, 0) * 4, heated=(True, True))
    result = score(tasks["lift-2"], engine_machine, rising)
    assert result.success
    assert result.indicator == pytest.approx(28 * 4, abs=0.01)
    assert result.flags == ()
    assert result.metrics["rise"] == pytest.approx(20.0, abs=0.1)


def test_a_rocket_that_only_hops_fails(tasks, engine_machine) -> None:
    hop = _climb(
        engine_machine, lambda t: np.maximum(40 - 16 * np.abs(t - 5), 0.0), heated=(True, True)
    )
    result = score(tasks["lift-2"], engine_machine, hop)
    assert result.indicator > 30
    assert not result.success


def test_a_success_with_less_thrust_than_weight_is_flagged(tasks, engine_machine) -> None:
    miracle = _climb(engine_machine, lambda t: np.maximum(t - 2, 0) * 4, heated=(False, False))
    result = score(tasks["lift-2"], engine_machine, miracle)
    assert result.success
    assert result.flags == ("twr_below_one",)


# Every task


def test_a_blow_up_is_never_a_success(tasks, car) -> None:
    thrown = make_trajectory(car, 30.0, moved=lambda t: _columns(1e4 * t**2, 0.0, 0.0, like=t))
    result = score(tasks["transport-1"], car, thrown)
    assert not result.success
    assert result.indicator == 0.0
    assert "unstable" in result.flags
    lost = make_trajectory(
        car, 30.0, moved=lambda t: _columns(np.where(t > 3, np.nan, 0.0), 0.0, 0.0, like=t)
    )
    assert "unstable" in score(tasks["transport-1"], car, lost).flags


def test_a_machine_never_finished_scores_nothing_but_tells_its_parts(tasks, car) -> None:
    for task in tasks.values():
        assert (failed_score(task).success, failed_score(task).indicator) == (False, 0.0)
        assert failed_score(task, car).metrics["parts"] == car.part_count


def _hops(first_s: float, height: float, low: float) -> Path:
    """Up to a height and down to another, then up for good, by 10 units/s."""
    top_s, down_s = first_s + height / 10, first_s + (2 * height - low) / 10
    times = [0, first_s, top_s, down_s, 40]
    heights = [0, 0, height, low, low + 10 * (40 - down_s)]
    return lambda t: np.interp(t, times, heights)


def _on_the_ground(machine: Machine, trial: Trajectory) -> Trajectory:
    """The trajectory from where the machine, its blocks upright, stands on the ground."""
    low = extents(machine, trial, axis=2)[0][0].min()
    return replace(trial, positions=trial.positions - np.array([0, 0, low], dtype=np.float32))


@pytest.mark.parametrize(
    ("height", "low", "counts"),
    [
        (20.0, 0.0, 20.0),  # it lands and takes off again
        (3.0, 0.0, 3.0),
        (1.6, 0.0, 1.6),
        (0.8, 0.0, None),  # it hops on its pad before it takes off
        (20.0, 1.0, None),  # it passes over the ground
    ],
)
def test_a_flight_ends_when_a_rocket_touches_the_ground(
    tasks, engine_machine, height, low, counts
) -> None:
    flight = _climb(engine_machine, _hops(2.0, height, low), heated=[True, True])
    flight = _on_the_ground(engine_machine, flight)
    result = score(tasks["lift-2"], engine_machine, flight)
    assert result.success == (counts is None)
    if counts is not None:
        top = float(flight.positions[0, :, 2].max())
        assert result.indicator == pytest.approx(counts + top, abs=0.4)
        assert result.metrics["landed_s"] == pytest.approx(2.0 + 2 * height / 10, abs=0.09)


@pytest.mark.parametrize("bounce_s", [6.0, 6.011, 6.027])
def test_a_bounce_between_two_samples_is_a_touch(tasks, engine_machine, bounce_s) -> None:
    def height(t: np.ndarray) -> np.ndarray:
        falling = 100.0 - np.abs(t - bounce_s / 2) * 200.0 / bounce_s
        return np.where(t < bounce_s, falling, 100.0 * (t - bounce_s))

    flight = _on_the_ground(engine_machine, _climb(engine_machine, height, heated=[True, True]))
    result = score(tasks["lift-2"], engine_machine, flight)
    assert not result.success
    assert result.indicator < 103.0
    assert result.metrics["landed_s"] == pytest.approx(bounce_s, abs=0.05)
