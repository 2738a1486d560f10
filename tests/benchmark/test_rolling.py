"""Transport: only what wheels drove counts. Trajectories made by hand."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from tests.benchmark.conftest import make_trajectory, rolled, wheels_of, with_bearing, with_pieces

from buildarena_benchmark import score
from buildarena_geometry import Machine
from buildarena_simulation import Trajectory

Path = Callable[[np.ndarray], np.ndarray]


def _driven(
    machine: Machine,
    *,
    moved: Path,
    turned: Path,
    borne: object = 1.0,
    cargo: Path | None = None,
    cargo_borne: object = 50.0,
    keys: str | None = None,
) -> Trajectory:
    """A machine that moves by (east, north), its wheels turned by angles; positive ones north."""

    def path(t: np.ndarray) -> np.ndarray:
        return np.column_stack([moved(t), np.zeros_like(t)])

    trial = make_trajectory(
        machine,
        30.0,
        moved=path,
        cargo=None if cargo is None else lambda t: np.column_stack([cargo(t), np.full_like(t, 2)]),
        cargo_mass=None if cargo is None else lambda t: np.full_like(t, 50.0),
        settings={"effective_key_presses": 1},
    )
    trial = rolled(machine, trial, turned, keys=keys)
    carried = cargo_borne if cargo else 0.0
    return with_bearing(trial, wheels=borne, wheel_ids=wheels_of(machine), cargo=carried)


def _north(speed: float) -> Path:
    return lambda t: np.column_stack([np.zeros_like(t), speed * t])


def _east(speed: float) -> Path:
    return lambda t: np.column_stack([speed * t, np.zeros_like(t)])


def _turn(rate: float) -> Path:
    return lambda t: rate * t


ROLLING = {"moved": _north(1.0), "turned": _turn(1.0)}


def test_a_car_that_rolls_counts_in_full(tasks, car) -> None:
    for rate in (1.0, -1.0):
        trial = _driven(car, moved=_north(rate), turned=_turn(rate))
        result = score(tasks["transport-1"], car, trial)
        assert (result.success, result.flags) == (True, ())
        assert result.indicator == pytest.approx(30.0, abs=1e-3)
        assert result.metrics["displacement"] == pytest.approx(30.0, abs=1e-3)


@pytest.mark.parametrize(
    "motion",
    [
        {"moved": _north(1.0), "turned": _turn(0.0)},  # pushed, or slid
        {"moved": _north(1.0), "turned": _turn(-1.0)},  # against its wheels
        {"moved": _east(1.0), "turned": _turn(10.0)},  # across its wheels
        {"moved": _north(1.0), "turned": _turn(10.0), "borne": 0.0},  # wheels in the air
        {"moved": _north(3.0), "turned": _turn(0.2)},  # farther than the wheels rolled
    ],
)
def test_what_wheels_did_not_drive_does_not_count(tasks, car, motion) -> None:
    result = score(tasks["transport-1"], car, _driven(car, **motion))
    assert not result.success
    assert result.indicator < 8.0
    assert result.flags == ("not_driven",)


@pytest.mark.parametrize(
    ("keys", "most"),
    [
        ([], 1.0),  # braked, and rolled by a push
        ([["UpArrow", 0.0, 5.0]], 5.5 * 1.05 + 0.5),  # let go, and pushed on
        ([["DownArrow", 0.0, 30.0]], 1.0),  # told to go back
        ([["UpArrow", 0.0, 30.0], ["DownArrow", 0.0, 30.0]], 1.0),  # brakes
        ([["Alpha1", 0.0, 30.0]], 1.0),  # a key of something else
    ],
)
def test_what_no_key_told_the_wheels_does_not_count(tasks, car, keys, most) -> None:
    trial = _driven(car, **ROLLING, keys=json.dumps(keys))
    result = score(tasks["transport-1"], car, trial)
    assert result.indicator <= most
    assert (result.success, result.flags) == (False, ("not_driven",))


@pytest.mark.parametrize(("speed", "counts"), [(10.4, 10.4), (11.5, 11.5), (20.0, 11.0), (40, 11)])
def test_wheels_drive_no_faster_than_their_motors_turn(tasks, car, speed, counts) -> None:
    trial = _driven(car, moved=_north(speed), turned=_turn(speed))
    indicator = score(tasks["transport-1"], car, trial).indicator
    most = 10.472 * 1.05 * 30.0 * 1.05 + 1.5
    assert indicator == pytest.approx(min(counts * 30.0, most), rel=0.06)
    assert indicator <= most


def test_wheels_that_burn_out_in_place_earn_nothing_for_a_throw(tasks, car) -> None:
    def thrown(t: np.ndarray) -> np.ndarray:
        return np.column_stack([np.zeros_like(t), np.where(t > 20.0, 18.0, 0.0)])

    trial = _driven(car, moved=thrown, turned=_turn(10.0))
    result = score(tasks["transport-1"], car, trial)
    assert (result.success, result.flags) == (False, ("not_driven",))
    assert result.indicator < 1.0


def test_a_wheel_that_bounces_drives(tasks, car) -> None:
    touches = (np.arange(751) % 8 == 0).astype(float)[:, None]
    trial = _driven(car, **ROLLING, borne=touches)
    assert score(tasks["transport-1"], car, trial).indicator == pytest.approx(30.0, abs=0.1)


def test_a_skid_after_a_drive_counts(tasks, car) -> None:
    def skids(t: np.ndarray) -> np.ndarray:
        braked = np.clip(t - 1.0, 0.0, 0.5)
        length = 10.0 * np.minimum(t, 1.0) + 10.0 * braked - 10.0 * braked**2
        return np.column_stack([np.zeros_like(t), length])

    def slides(t: np.ndarray) -> np.ndarray:
        return np.column_stack([np.zeros_like(t), 10.0 * np.minimum(t, 3.0)])

    def turned(t: np.ndarray) -> np.ndarray:
        return 10.0 * np.minimum(t, 1.0)

    skid = _driven(car, moved=skids, turned=turned)
    assert score(tasks["transport-1"], car, skid).indicator == pytest.approx(12.5, abs=0.01)
    # A slide that does not slow down is no skid: something else pushes.
    slide = _driven(car, moved=slides, turned=turned)
    assert score(tasks["transport-1"], car, slide).indicator < 10.0 * 1.05 + 0.5 + 3.5


def test_one_good_wheel_is_enough(tasks, car) -> None:
    borne = np.zeros((751, 4))
    borne[:, 2] = 5.0
    trial = _driven(car, **ROLLING, borne=borne)
    assert score(tasks["transport-1"], car, trial).success


def test_wheels_that_came_off_drive_nothing(tasks, car) -> None:
    trial = _driven(car, **ROLLING)
    apart = with_pieces(trial, *([wheel] for wheel in wheels_of(car)), since_s=4.0)
    result = score(tasks["transport-1"], car, apart)
    assert result.indicator == pytest.approx(4.0 * 1.05 + 0.5, abs=0.1)
    assert result.flags == ("not_driven",)


@pytest.mark.parametrize(("borne", "counts"), [(50.0, 30.0), (30.0, 30.0), (20.0, 0.0), (0.0, 0.0)])
def test_a_cargo_counts_while_the_machine_bears_it(tasks, car, borne, counts) -> None:
    trial = _driven(car, **ROLLING, cargo=_north(1.0), cargo_borne=borne)
    result = score(tasks["transport-2"], car, trial)
    assert result.indicator == pytest.approx(counts, abs=1e-3)
    assert result.flags == (() if counts else ("not_driven",))


def test_a_cargo_that_is_thrown_off_a_car_counts_until_then(tasks, car) -> None:
    times = np.arange(751) / 25

    def flies(t: np.ndarray) -> np.ndarray:
        return np.column_stack([np.zeros_like(t), t + np.where(t > 6.0, 9.0, 0.0)])

    borne = np.where(times <= 6.0, 50.0, 0.0)
    trial = _driven(car, **ROLLING, cargo=flies, cargo_borne=borne)
    result = score(tasks["transport-2"], car, trial)
    assert not result.success
    assert result.indicator < 7.5
    hops = np.where(np.arange(751) % 6 == 0, 300.0, 0.0)
    carried = _driven(car, **ROLLING, cargo=_north(1.0), cargo_borne=hops)
    assert score(tasks["transport-2"], car, carried).success


def test_wheels_that_are_not_tracked_are_not_measured(tasks, car) -> None:
    trial = _driven(car, moved=_north(1.0), turned=_turn(0.0))
    poses = {"positions": trial.positions[:, :1], "quaternions": trial.quaternions[:, :1]}
    first = replace(trial, block_ids=trial.block_ids[:1], **poses)
    result = score(tasks["transport-1"], car, first)
    assert (result.success, result.flags) == (True, ("drive_not_measured",))


# There and back


def _legs(*points: tuple[float, float], speed: float = 5.0, rest_s: float = 0.5) -> Path:
    """A way along points from (0, 0) at a speed, with a rest at each."""
    times, places = [0.0], [(0.0, 0.0)]
    for point in points:
        way = float(np.hypot(*np.subtract(point, places[-1])))
        times += [times[-1] + way / speed, times[-1] + way / speed + rest_s]
        places += [point, point]
    return lambda t: np.column_stack(
        [np.interp(t, times, [place[axis] for place in places]) for axis in (0, 1)]
    )


def _carried_along(machine: Machine, *points: tuple[float, float], **how: object) -> Trajectory:
    moved = _legs(*points)
    turned = lambda t: moved(t)[:, 1]  # noqa: E731 - the wheels roll north as it does
    return _driven(machine, moved=moved, turned=turned, cargo=moved, **how)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("points", "success", "way"),
    [
        ([(10, 10), (0, 0)], True, 26.28),
        ([(8.7, 8.7), (1.3, 1.3)], True, 22.7),
        ([(8.5, 8.5), (0, 0)], False, 12.02),  # not quite there
        ([(10, 10), (1.5, 1.5)], False, 24.16),  # not quite back
        ([(10, 10)], False, 14.14),  # one way
        ([(30, 30)], False, 14.14),  # straight on
        ([(30, 30), (0, 0)], True, 26.28),  # beyond, and back
        ([(0, 30), (0, 0)], False, 4.14),  # north and back
        ([(-10, -10), (10, 10), (0, 0)], True, 26.28),
        ([(0, 0)], False, 0.0),
    ],
)
def test_the_way_there_and_back_counts(tasks, car, points, success, way) -> None:
    result = score(tasks["transport-3"], car, _carried_along(car, *points))
    assert result.success == success
    assert result.indicator == pytest.approx(way, abs=0.25)
    farthest = max(np.hypot(*point) for point in points)
    assert result.metrics["driven_distance"] == pytest.approx(farthest, abs=0.2)


def test_the_way_back_is_driven_and_carried(tasks, car) -> None:
    trial = _carried_along(car, (10, 10), (0, 0))
    assert trial.cargo_position is not None
    there_s = score(tasks["transport-3"], car, trial).metrics["there_s"]
    late = trial.time_s > float(there_s or 0.0) + 0.5
    borne = np.where(late, 0.0, 50.0)
    thrown = _carried_along(car, (10, 10), (0, 0), cargo_borne=borne)
    pushed = _carried_along(car, (10, 10), (0, 0), keys='[["UpArrow", 0, 30]]')
    for other in (thrown, pushed):
        result = score(tasks["transport-3"], car, other)
        assert (result.success, result.flags) == (False, ("not_driven",))
        assert result.indicator < 18.0


def test_the_papers_reading_of_the_way_stays_with_the_smaller_cargo(tasks, car) -> None:
    away = _carried_along(car, (0, 30))
    assert score(tasks["transport-2"], car, away).indicator == pytest.approx(30.0, abs=0.1)
    assert score(tasks["transport-3"], car, away).metrics["displacement"] == pytest.approx(30.0)
