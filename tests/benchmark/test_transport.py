"""Transport: only what wheels drove counts. Trajectories made by hand."""

import json
from dataclasses import replace

import numpy as np
import pytest
from tests.benchmark.conftest import (
    Path,
    make_trajectory,
    rolled,
    shifted,
    wheels_of,
    with_bearing,
    with_pieces,
)

from buildarena_benchmark import failed_score, score
from buildarena_benchmark.scores import decided_length
from buildarena_geometry import Machine
from buildarena_simulation import Trajectory

TIMES = np.arange(751) / 25


def _planar(east: Path, north: Path) -> Path:
    return lambda t: np.column_stack([east(t), north(t)])


def _north(speed: float) -> Path:
    return _planar(np.zeros_like, lambda t: speed * t)


def _east(speed: float) -> Path:
    return _planar(lambda t: speed * t, np.zeros_like)


def _turn(rate: float) -> Path:
    return lambda t: rate * t


AHEAD, TURNING = _north(1.0), _turn(1.0)


def _driven(
    machine: Machine,
    *,
    moved: Path = AHEAD,
    turned: Path = TURNING,
    support: object = 1.0,
    cargo: Path | None = None,
    cargo_borne: object = 50.0,
    keys: list[list[object]] | None = None,
) -> Trajectory:
    """A machine that moves by (east, north), its wheels turned by angles; positive ones north."""
    trial = make_trajectory(
        machine,
        30.0,
        moved=lambda t: np.column_stack([moved(t), np.zeros_like(t)]),
        cargo=None if cargo is None else lambda t: np.column_stack([cargo(t), np.full_like(t, 2)]),
        cargo_mass=None if cargo is None else lambda t: np.full_like(t, 50.0),
        settings={"effective_key_presses": 1},
    )
    trial = rolled(machine, trial, turned, keys=None if keys is None else json.dumps(keys))
    carried = cargo_borne if cargo else 0.0
    return with_bearing(trial, wheels=support, wheel_ids=wheels_of(machine), cargo=carried)


def test_a_car_that_rolls_counts_in_full(tasks, car, subtests) -> None:
    one_wheel = np.zeros((751, 4))
    one_wheel[:, 2] = 5.0
    for name, how in {
        "north": {},
        "south": {"moved": _north(-1.0), "turned": _turn(-1.0)},
        "one good wheel is enough": {"support": one_wheel},
        "a wheel that bounces": {"support": (np.arange(751) % 8 == 0).astype(float)[:, None]},
    }.items():
        with subtests.test(name=name):
            result = score(tasks["transport-1"], car, _driven(car, **how))
            assert (result.success, result.flags) == (True, ())
            assert result.indicator == pytest.approx(30.0, abs=0.1)
            assert result.metrics["displacement"] == pytest.approx(30.0, abs=1e-3)


def test_a_trial_ends_a_second_after_nothing_moves_and_no_key_is_left(tasks, car, subtests) -> None:
    task = tasks["transport-1"]

    def parked(t: np.ndarray) -> np.ndarray:
        return np.minimum(t, 12.0)

    def nudged(t: np.ndarray) -> np.ndarray:
        return parked(t) + np.where(t > 25.0, 5.0, 0.0)

    def creeping(t: np.ndarray) -> np.ndarray:
        return parked(t) + 0.05 * np.maximum(t - 12.0, 0.0)

    whole = task.scenario.sample_count
    at_12 = [["UpArrow", 0.0, 12.0]]
    for name, way, keys, length in (
        ("parked", parked, at_12, 25 * 14 + 1),
        ("moved later by something else", nudged, at_12, 25 * 14 + 1),
        ("a key that is held on", parked, [["UpArrow", 0.0, 20.0]], 25 * 22 + 1),
        ("a key that is still to come", parked, [*at_12, ["UpArrow", 28.0, 1.0]], whole),
        ("it creeps", creeping, at_12, whole),
    ):
        with subtests.test(name=name):
            moved = _planar(np.zeros_like, way)
            trial = _driven(car, moved=moved, turned=parked, keys=keys)
            assert decided_length(task, trial) == length
            ended = trial.first(length)
            assert ended.bearing is not None
            assert len(ended.bearing.wheels) == len(ended.time_s) == length
            assert score(task, car, ended) == score(task, car, trial)
            displacement = score(task, car, trial).metrics["displacement"]
            assert displacement == pytest.approx(12.9 if way is creeping else 12.0)
    unknown = replace(trial, settings={"effective_key_presses": 1})
    assert decided_length(task, unknown) == whole


def test_what_wheels_did_not_drive_does_not_count(tasks, car, subtests) -> None:
    def thrown(t: np.ndarray) -> np.ndarray:
        return np.where(t > 20.0, 18.0, 0.0)

    up, down = ["UpArrow", 0.0, 30.0], ["DownArrow", 0.0, 30.0]
    for name, how, most in (
        ("pushed, or slid", {"turned": _turn(0.0)}, 1.0),
        ("against its wheels", {"turned": _turn(-1.0)}, 1.0),
        ("across its wheels", {"moved": _east(1.0), "turned": _turn(10.0)}, 1.0),
        ("wheels in the air", {"turned": _turn(10.0), "support": 0.0}, 1.0),
        ("farther than they rolled", {"moved": _north(3.0), "turned": _turn(0.2)}, 8.0),
        ("braked, and rolled by a push", {"keys": []}, 1.0),
        ("let go, and pushed on", {"keys": [["UpArrow", 0.0, 5.0]]}, 5.5 * 1.05 + 0.5),
        ("commanded to go back", {"keys": [down]}, 1.0),
        ("brakes", {"keys": [up, down]}, 1.0),
        ("a key of something else", {"keys": [["Alpha1", 0.0, 30.0]]}, 1.0),
        (
            "burnt out in place, then thrown",
            {"moved": _planar(np.zeros_like, thrown), "turned": _turn(10.0)},
            1.0,
        ),
    ):
        with subtests.test(name=name):
            result = score(tasks["transport-1"], car, _driven(car, **how))
            assert (result.success, result.flags) == (False, ("not_driven",))
            assert result.indicator <= most


def test_wheels_drive_no_faster_than_their_motors_turn(tasks, car) -> None:
    most = 10.472 * 1.05 * 30.0 * 1.05 + 1.5
    for speed, counts in ((10.4, 10.4), (11.5, 11.5), (20.0, 11.0), (40, 11)):
        trial = _driven(car, moved=_north(speed), turned=_turn(speed))
        indicator = score(tasks["transport-1"], car, trial).indicator
        assert indicator == pytest.approx(min(counts * 30.0, most), rel=0.06)
        assert indicator <= most


def test_a_skid_after_a_drive_counts_and_a_slide_does_not(tasks, car) -> None:
    def skids(t: np.ndarray) -> np.ndarray:
        braked = np.clip(t - 1.0, 0.0, 0.5)
        return 10.0 * np.minimum(t, 1.0) + 10.0 * braked - 10.0 * braked**2

    def slides(t: np.ndarray) -> np.ndarray:
        return 10.0 * np.minimum(t, 3.0)

    def turned(t: np.ndarray) -> np.ndarray:
        return 10.0 * np.minimum(t, 1.0)

    driven = [_driven(car, moved=_planar(np.zeros_like, w), turned=turned) for w in (skids, slides)]
    skid, slide = (score(tasks["transport-1"], car, trial).indicator for trial in driven)
    assert skid == pytest.approx(12.5, abs=0.01)
    # A slide that does not slow down is not a skid: something else pushes.
    assert slide < 10.0 * 1.05 + 0.5 + 3.5


def test_wheels_that_came_off_drive_nothing(tasks, car) -> None:
    apart = with_pieces(_driven(car), *([wheel] for wheel in wheels_of(car)), since_s=4.0)
    result = score(tasks["transport-1"], car, apart)
    assert result.indicator == pytest.approx(4.0 * 1.05 + 0.5, abs=0.1)
    assert result.flags == ("not_driven",)


def test_a_cargo_counts_while_the_machine_bears_it(tasks, car, subtests) -> None:
    flies = _planar(np.zeros_like, lambda t: t + np.where(t > 6.0, 9.0, 0.0))
    for name, cargo, support, success, least, most in (
        ("carried", _north(1.0), 50.0, True, 29.9, 30.1),
        ("hardly less", _north(1.0), 30.0, True, 29.9, 30.1),
        ("dragged", _north(1.0), 20.0, False, 0.0, 1e-3),
        ("not touched", _north(1.0), 0.0, False, 0.0, 1e-3),
        ("hops", _north(1.0), np.where(np.arange(751) % 6 == 0, 300.0, 0.0), True, 29.0, 30.1),
        ("thrown off at 6 s", flies, np.where(TIMES <= 6.0, 50.0, 0.0), False, 5.0, 7.5),
    ):
        with subtests.test(name=name):
            trial = _driven(car, cargo=cargo, cargo_borne=support)
            result = score(tasks["transport-2"], car, trial)
            assert (result.success, result.flags) == (success, () if success else ("not_driven",))
            assert least <= result.indicator <= most


def test_how_far_how_straight_and_with_what_is_measured(tasks, car) -> None:
    """Wheels that are not tracked: the drive itself is not judged."""

    def scored(trial: Trajectory, task: str = "transport-1"):
        tracked = {"block_ids": trial.block_ids[:1], "bearing": None}
        tracked |= {name: getattr(trial, name)[:, :1] for name in ("positions", "quaternions")}
        return score(tasks[task], car, replace(trial, **tracked))

    aslant = _planar(lambda t: t / np.sqrt(2), lambda t: t / np.sqrt(2))
    result = scored(_driven(car, moved=aslant, turned=_turn(0.0)))
    assert (result.success, result.flags) == (True, ("drive_not_measured",))
    assert result.indicator == pytest.approx(30.0, abs=1e-3)
    expected = {"parts": car.part_count, "wheels": 4, "lateral_deviation": 0.0, "backtrack": 0.0}
    expected |= dict.fromkeys(("direction_consistency", "path_efficiency", "max_speed"), 1.0)
    found = {name: result.metrics[name] for name in expected}
    assert found == pytest.approx(expected, abs=1e-2)
    for speed, success in ((0.33, False), (0.34, True)):  # more than ten in 30 s
        assert scored(_driven(car, moved=_north(speed))).success == success
    there_and_back = scored(_driven(car, moved=_planar(np.zeros_like, lambda t: 15 - abs(t - 15))))
    assert there_and_back.indicator == pytest.approx(15.0, abs=1e-3)  # the farthest, not the last
    assert there_and_back.metrics["backtrack"] > 0.5
    assert there_and_back.metrics["path_efficiency"] < 0.1


def test_wheels_that_are_driven_are_asked_for(tasks, car, engine_machine) -> None:
    def driven(machine: Machine, presses: int):
        trial = make_trajectory(machine, 30.0, moved=lambda t: np.outer(t, [1, 0, 0]))
        settings = {"effective_key_presses": presses} if presses else {}
        return score(tasks["transport-1"], machine, replace(trial, settings=settings))

    assert car.act("reset_control_sequence", {}).ok
    result = driven(car, 0)
    assert (result.success, result.indicator) == (False, 0.0)
    assert driven(car, 2).success
    assert car.act("remove_block", {"block_id": wheels_of(car)[0]}).ok
    result = driven(car, 2)
    assert (result.success, result.metrics["wheels"]) == (False, 3)
    load = {"cargo": lambda t: np.column_stack([t, np.zeros_like(t), np.full_like(t, 2)])}
    load |= {"cargo_mass": lambda t: np.full_like(t, 50.0), "heated": (False, False)}
    pushed = make_trajectory(engine_machine, 30.0, **load, settings={"effective_key_presses": 1})
    result = score(tasks["transport-2"], engine_machine, pushed)
    assert (result.success, result.flags) == (True, ("no_wheels", "drive_not_measured"))


def test_a_start_too_high_and_wheels_that_drift_apart_are_told(tasks, car) -> None:
    def fallen(t: np.ndarray) -> np.ndarray:
        return np.column_stack([t, np.zeros_like(t), np.maximum(20.0 - 10 * t, 0.0)])

    result = score(tasks["transport-1"], car, make_trajectory(car, 30.0, moved=fallen))
    assert (result.success, result.flags) == (False, ("start_too_high", "drive_not_measured"))
    trial = _driven(car)
    assert score(tasks["transport-1"], car, trial).metrics["intact"] is True
    apart = shifted(trial, np.outer(np.linspace(0, 2, 751), [1, 0, 0]), wheels_of(car)[0])
    assert score(tasks["transport-1"], car, apart).metrics["intact"] is False


def test_a_machine_never_finished_scores_nothing_but_tells_its_parts(tasks, car) -> None:
    for task in tasks.values():
        assert (failed_score(task).success, failed_score(task).indicator) == (False, 0.0)
        assert failed_score(task, car).metrics["parts"] == car.part_count


# There and back


def _along(machine: Machine, *points: tuple[float, float], **how: object) -> Trajectory:
    """A drive with its cargo along points from (0, 0) at 5 units/s, with half a second at each."""
    times, places = [0.0], [(0.0, 0.0)]
    for point in points:
        way = float(np.hypot(*np.subtract(point, places[-1])))
        times += [times[-1] + way / 5.0, times[-1] + way / 5.0 + 0.5]
        places += [point, point]
    moved = _planar(*(lambda t, at=at: np.interp(t, times, at) for at in zip(*places, strict=True)))
    return _driven(machine, moved=moved, turned=lambda t: moved(t)[:, 1], cargo=moved, **how)  # type: ignore[arg-type]


def test_the_way_there_and_back_counts(tasks, car, subtests) -> None:
    for points, success, way in (
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
    ):
        with subtests.test(points=points):
            trial = _along(car, *points)
            result = score(tasks["transport-3"], car, trial)
            assert result.success == success
            assert result.indicator == pytest.approx(way, abs=0.25)
            farthest = max(np.hypot(*point) for point in points)
            assert result.metrics["driven_distance"] == pytest.approx(farthest, abs=0.2)
            smaller = score(tasks["transport-2"], car, trial)  # the paper's reading of the way
            assert smaller.indicator == pytest.approx(farthest, abs=0.2)


def test_the_way_back_is_driven_and_carried(tasks, car) -> None:
    trial = _along(car, (10, 10), (0, 0))
    there_s = float(score(tasks["transport-3"], car, trial).metrics["there_s"] or 0.0)
    for how in (
        {"cargo_borne": np.where(there_s + 0.5 < TIMES, 0.0, 50.0)},
        {"keys": [["UpArrow", 0, 30]]},
    ):
        result = score(tasks["transport-3"], car, _along(car, (10, 10), (0, 0), **how))
        assert (result.success, result.flags) == (False, ("not_driven",))
        assert result.indicator < 18.0
