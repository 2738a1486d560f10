"""Flight, and flights round a planet: what counts, and what does not. Trajectories by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support.machines.piloted import experts_machine
from tests.benchmark.conftest import Path, make_trajectory, strict, with_bearing, with_pieces

from buildarena_benchmark import score
from buildarena_benchmark.tasks.space.orbits import swept
from buildarena_geometry import Machine
from buildarena_simulation import Trajectory


def climb(
    machine: Machine,
    *,
    steps: tuple[tuple[float, float], ...] = (
        (0, 0.5),
        (3, 8),
        (9, 8),
        (12, 14),
        (18, 14),
        (21, 11),
    ),
    drift: float = 0.0,
    tilt_deg: float = 0.0,
    support: object = 5.0,
    ground: object = 0.0,
) -> Trajectory:
    """A machine that goes from height to height, which are given with their times, and stays."""
    start = next(iter(machine.blocks.values())).center_xyz[2]

    def moved(t: np.ndarray) -> np.ndarray:
        height = np.interp(t, *zip(*steps, strict=True))
        return np.column_stack([drift * t, np.zeros_like(t), height - start])

    cargo = {"cargo": lambda t: moved(t) + np.array([0, 0, 2])}
    cargo["cargo_mass"] = lambda t: np.full_like(t, 5.0)
    trial = make_trajectory(machine, 30.0, moved=moved, **cargo)
    half = np.radians(tilt_deg) / 2 * (trial.time_s > 1.0)
    quaternions = np.zeros_like(trial.quaternions)
    quaternions[:, :, 0], quaternions[:, :, 1] = np.cos(half)[:, None], np.sin(half)[:, None]
    return with_bearing(replace(trial, quaternions=quaternions), cargo=support, ground=ground)


def test_which_heights_are_held(tasks, car, subtests) -> None:
    task = tasks["flight-3"]
    for name, how, flags in (
        ("in order", {}, None),
        ("far above all of them", {"steps": ((0, 0.5), (3, 30), (30, 30))}, ()),
        ("through them", {"steps": ((0, 0.5), (30, 20))}, ()),
        ("in another order", {"steps": ((0, 0.5), (3, 14), (12, 14), (15, 8), (30, 8))}, ()),
        ("tilted", {"tilt_deg": 21.0}, ()),
        ("hardly tilted", {"tilt_deg": 19.0}, None),
        ("drifts off", {"drift": 0.6}, ()),
        ("without its cargo", {"support": 0.0}, ("not_carried",)),
        ("half of it hangs on something else", {"support": 3.5}, ("not_carried",)),
        ("a tower, or an anchor", {"ground": 3.0}, ("not_airborne",)),
        ("grazes", {"ground": 0.05}, None),
        (
            "began up there",
            {"steps": ((0, 7), (9, 8), (12, 14), (18, 14), (21, 11))},
            ("not_risen",),
        ),
    ):
        with subtests.test(name=name):
            result = score(task, car, climb(car, **how))
            assert (result.success, result.flags) == (flags is None, flags or ())


# Glide


def glide(
    machine: Machine,
    *,
    speed: float = 15.0,
    sink: float = 4.0,
    flare: float | None = None,
    land: bool = True,
) -> Trajectory:
    end_s = 40.0 / sink

    def moved(t: np.ndarray) -> np.ndarray:
        fall = 40.0 - np.minimum(sink * t, 40.0)
        if flare is not None:
            fall = np.where(t > end_s - 1, flare * np.maximum(end_s - t, 0), fall)
        return np.column_stack([np.zeros_like(t), speed * np.minimum(t, end_s), fall])

    trial = make_trajectory(machine, 30.0, moved=moved)
    touches = trial.time_s > end_s - 1e-9
    return with_bearing(trial, ground=np.where(touches & land, float(machine.mass), 0.0))


def test_what_is_a_glide(tasks, car, subtests) -> None:
    result = score(tasks["flight-2"], car, glide(car))
    assert result.indicator == pytest.approx(150 / 40, rel=0.01)
    assert result.metrics["sink_at_landing"] == pytest.approx(4.0, rel=0.01)
    for name, how, success in (
        ("lands gently", {}, True),
        ("not far enough", {"speed": 7.9}, False),
        ("far enough", {"speed": 8.2}, True),
        ("too hard", {"sink": 6.5, "speed": 20.0}, False),
        ("a flare before the ground", {"sink": 6.5, "speed": 20.0, "flare": 3.0}, True),
        ("a dive at the end", {"sink": 3.0, "flare": 9.0}, False),
        ("never comes down", {"land": False}, False),
        ("not within the trial", {"sink": 1.0}, False),
        ("a stone", {"sink": 25.6}, False),
    ):
        with subtests.test(name=name):
            assert score(tasks["flight-2"], car, glide(car, **how)).success == success


def test_the_flight_ends_at_the_first_touch_of_what_is_still_joined(tasks, car) -> None:
    touched = np.zeros(751)
    touched[100] = 30.0  # touches at 4 s, and flies on
    result = score(tasks["flight-2"], car, with_bearing(glide(car), ground=touched))
    assert (result.success, result.indicator) == (False, 0.0)
    assert result.metrics["range"] == pytest.approx(60, rel=0.01)
    trial = glide(car, sink=8.0, speed=20.0)
    light = list(car.blocks)[3:]
    positions = trial.positions.copy()
    positions[:, 3:, 2] = 60.0  # what came off does not soften the landing
    off = with_pieces(replace(trial, positions=positions), light, since_s=1)
    result = score(tasks["flight-2"], car, off)
    assert result.metrics["sink_at_landing"] == pytest.approx(8.0, rel=0.01)
    assert not result.success


def test_without_forces_nothing_can_be_judged(tasks, car) -> None:
    for name, trial in (("flight-2", glide(car)),):
        result = score(tasks[name], car, replace(trial, bearing=None))
        assert (result.success, result.flags) == (False, ("forces_not_measured",))


# Round a planet

RADIUS = 600.0


def test_what_swings_to_and_fro_goes_nowhere() -> None:
    ways = ((0, 2, 50), (2, -2, 100), (-2, 0.5, 60))
    swings = np.concatenate([np.linspace(*way) for way in ways])
    for turns, angle in ((swings, 0.5), (np.linspace(0, 6 * math.pi, 200), 6 * math.pi)):
        path = 640 * np.stack([np.sin(turns), 0 * turns, np.cos(turns)], axis=1)
        assert abs(swept(path, np.zeros(3))[-1]) == pytest.approx(angle)
    assert (swept(np.zeros((4, 3)), np.zeros(3)) == 0).all()


@pytest.fixture
def rocket(tasks) -> Machine:
    """The expert's, driven by a key."""
    machine = experts_machine(tasks["orbit-2"])
    key = {"block_id": "2", "action": "thrust_left", "new_key": "UpArrow"}
    assert machine.act("add_control_key", key).ok
    return machine


def orbit(
    machine: Machine,
    rounds: float,
    height: Path,
    *,
    end_s: float = 120.0,
    circle: float = 0.0,
    ground_from_s: float = np.inf,
) -> Trajectory:
    """So many rounds from 2 s to a time, faster for 10 s; or circles over the north."""
    start = next(iter(machine.blocks.values())).center_xyz

    def moved(t: np.ndarray) -> np.ndarray:
        since = np.clip(t - 2, 0, end_s - 2)
        gone = np.where(since < 10, since**2 / 20, since - 5) / (end_s - 7)
        angle, away = 2 * np.pi * rounds * gone, RADIUS + height(t)
        over = np.sqrt(away**2 - circle**2) if circle else np.cos(angle) * away
        north = circle * np.cos(angle)
        return np.stack([(circle or away) * np.sin(angle), north, over - RADIUS], axis=1) - start

    settings = {"presses": '[["UpArrow", 0.0, 120.0]]'}
    trial = make_trajectory(machine, 120.0, moved=moved, settings=settings)
    support = np.where(trial.time_s > ground_from_s, float(machine.mass), 0.0)
    return with_bearing(trial, ground=support)


def test_what_is_a_way_round_a_planet(tasks, rocket, subtests) -> None:
    rounds_only = strict(tasks["orbit-2"], landing=None, cycles=3.0, least_height=20.0)

    def up(t: np.ndarray) -> np.ndarray:
        return np.minimum(60.0, 20.0 * t)

    for name, rounds, height, cycles, success in (
        ("round", 3.1, up, 3.1, True),
        ("not quite", 2.9, up, 2.9, False),
        ("the other way", -3.1, up, 3.1, True),
        ("rolls round", 3.1, lambda t: np.full_like(t, 0.5), 0.0, False),
        ("hops", 3.1, lambda t: np.full_like(t, 19.0), 0.0, False),
        (
            "comes down on its way",
            4.0,
            lambda t: np.where(abs(t - 62) < 0.1, 19.9, up(t)),
            2,
            False,
        ),
    ):
        with subtests.test(name=name):
            result = score(rounds_only, rocket, orbit(rocket, rounds, height))
            assert (result.success, result.flags) == (success, ())
            assert result.metrics["cycles"] == pytest.approx(cycles, abs=0.1)
            lasted_s = 7 + 113 * 3 / abs(rounds)
            assert result.indicator == pytest.approx(180 / lasted_s * success, rel=0.01)
    for circle in (5.0, 50.0, 300.0):
        trial = orbit(rocket, 10, lambda t: np.full_like(t, 60.0), circle=circle)
        cycles = score(rounds_only, rocket, trial).metrics["cycles"]
        # As many units along a great circle are worth 660 / radius times as much.
        assert cycles == pytest.approx(10 * (circle / 660) ** 2, rel=0.02)


def test_what_is_a_return(tasks, rocket, subtests) -> None:
    def lands(t: np.ndarray, sink: float) -> np.ndarray:
        return np.clip(np.minimum(30.0 * t, sink * (52 - t)), 0.5, 100.0)

    for name, sink, end, ground_s, success in (
        ("softly", 5.0, 1.0, 51.8, True),
        ("hard", 7.0, 1.0, 51.8, False),
        ("it only hovers", 5.0, 1.0, np.inf, False),
        ("near the start", 5.0, 1.0 + 29 / (RADIUS * 2 * np.pi), 51.8, True),
        ("elsewhere", 5.0, 1.0 + 31 / (RADIUS * 2 * np.pi), 51.8, False),
    ):
        with subtests.test(name=name):
            trial = orbit(
                rocket,
                end,
                lambda t, sink=sink: lands(t, sink),
                end_s=32.0,
                ground_from_s=ground_s,
            )
            result = score(tasks["orbit-2"], rocket, trial)
            assert result.success == success, result
            assert (result.indicator > 0) == success
            if success:
                apart = with_pieces(trial, list(rocket.blocks)[2:3], since_s=54.0)
                result = score(tasks["orbit-2"], rocket, apart)
                assert (result.success, result.flags) == (False, ("came_apart",))
