"""Which rollouts blew up, and which merely went badly. Trajectories made by hand."""

from dataclasses import replace

import numpy as np
from support.machines.building import BLOCK, attach, built
from tests.benchmark.conftest import make_trajectory, shifted, with_bearing, with_pieces

from buildarena_benchmark import score
from buildarena_benchmark.scoring.measures.energy import gains_energy
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_geometry import Machine, module_set
from buildarena_simulation import Trajectory
from buildarena_simulation.constants import GRAVITY


def _bridge(machine: Machine, *, falls_at: float = 8.0) -> Trajectory:
    """A cargo that is carried at 6.75 and falls freely from a time on."""

    def path(t: np.ndarray) -> np.ndarray:
        sunk = GRAVITY / 2 * np.maximum(t - falls_at, 0.0) ** 2
        height = np.maximum(9.0 - GRAVITY / 2 * t**2, 6.75) - sunk
        return np.outer(np.maximum(height, 0.75), [0, 0, 1])

    def mass(t: np.ndarray) -> np.ndarray:
        return 5 + 1495 * np.clip((t - 0.5) / 15, 0.005, 1)

    return make_trajectory(machine, 17.0, cargo=path, cargo_mass=mass)


def _kicked(trial: Trajectory, *blocks: str, at: float, speed: float, samples: int) -> Trajectory:
    """The trajectory in which blocks, or all, are thrown east for some samples, then stay."""
    ran = np.clip(np.arange(len(trial.time_s)) - round(at * 25) + 1, 0, samples)
    return shifted(trial, np.outer(ran * speed / 25, [1, 0, 0]), *blocks)


def test_a_blow_up_lasts_and_decides_before_the_end_alone(tasks, car) -> None:
    bridge = _bridge(car)
    debris = with_pieces(bridge, ["4", "5"], since_s=7.9)
    for trial, kick, unstable in (
        (bridge, {"at": 4.0, "speed": 2000.0, "samples": 1}, False),  # a solver's correction
        (bridge, {"at": 4.0, "speed": 2000.0, "samples": 2}, False),
        (bridge, {"at": 4.0, "speed": 2000.0, "samples": 3}, True),
        (bridge, {"at": 4.0, "speed": 500.0, "samples": 10}, True),
        (bridge, {"at": 9.0, "speed": 2000.0, "samples": 20}, False),  # after the fall
    ):
        result = score(tasks["support-1"], car, _kicked(trial, **kick))
        assert ("unstable" in result.flags) == unstable, kick
    for at in (7.96, 8.2, 9.0):  # debris of a collapse
        kicked = _kicked(debris, "4", "5", at=at, speed=69.0, samples=10)
        result = score(tasks["support-1"], car, kicked)
        assert "unstable" not in result.flags
    for since_s, success in ((9.0, True), (7.0, False)):
        lost = np.where(bridge.time_s > since_s, np.nan, 0.0)
        result = score(tasks["support-1"], car, shifted(bridge, np.outer(lost, [1, 1, 1])))
        assert (result.success, "unstable" in result.flags) == (success, not success)
        assert (result.indicator > 0) == success
    held = _bridge(car, falls_at=99.0)
    cargo = held.cargo_position.copy()
    cargo[held.time_s > 6.0, 2] += 40.0 * np.arange((held.time_s > 6.0).sum())
    shot = score(tasks["support-1"], car, replace(held, cargo_position=cargo))
    assert "unstable" in shot.flags, "a cargo that is shot away"


def test_a_rocket_may_be_as_fast_as_its_thrust_makes_it(tasks, engine_machine) -> None:
    push = (2 * 13.76 / 3.25 - 1.0) * GRAVITY

    def flight(factor: float) -> Trajectory:
        def climb(t: np.ndarray) -> np.ndarray:
            return np.outer(factor * push / 2 * np.maximum(t - 2.0, 0.0) ** 2, [0, 0, 1])

        return make_trajectory(engine_machine, 30.0, moved=climb, heated=(True, True))

    assert score(tasks["lift-2"], engine_machine, flight(1.0)).success
    assert "unstable" in score(tasks["lift-2"], engine_machine, flight(3.0)).flags
    shot = _kicked(flight(0.5), "3", at=6.0, speed=20_000.0, samples=200)
    assert "unstable" in score(tasks["lift-2"], engine_machine, shot).flags
    off = with_pieces(shot, ["3"], since_s=5.9)  # a part that came off decides nothing
    assert score(tasks["lift-2"], engine_machine, off).flags == ()


def _flown(
    machine: Machine, *, climb: float, speed: float = 15.0, sink: float = 0.0, presses: str = "[]"
) -> Trajectory:
    """A flight at a speed, from 40 up that climbs evenly for 10 s."""

    def moved(t: np.ndarray) -> np.ndarray:
        up = 40.0 + climb * np.minimum(t, 10.0) / 10.0 - sink * t
        return np.column_stack([np.zeros_like(t), speed * t, up])

    return with_bearing(make_trajectory(machine, 12.0, moved=moved, settings={"presses": presses}))


def test_what_nothing_drives_gains_no_energy(tasks, car) -> None:
    glider = built(*(("1", face, BLOCK) for face in "ABE"))
    for how, gains in (
        ({"climb": 20.0}, True),
        ({"climb": 5.0}, True),
        ({"climb": 1.0}, False),  # within what engines err
        ({"climb": 0.0}, False),
        ({"climb": 0.0, "speed": 21.0}, True),
        ({"climb": 2.0, "speed": 9.0}, False),  # it climbs on its speed
        ({"climb": 0.0, "speed": 24.0, "sink": 3.0}, True),
    ):
        result = score(tasks["flight-2"], glider, _flown(glider, **how))
        assert ("unstable" in result.flags) == gains, how
    for presses, gains in (("[]", True), ('[["UpArrow",0.0,1.0]]', False), ('[["x",0,1]]', True)):
        trial = _flown(car, climb=20.0, presses=presses)
        run = Run(scenario=tasks["transport-1"].scenario, machine=car, trajectory=trial)
        assert gains_energy(run, 300) == gains, presses
    scenario = tasks["flight-3"].scenario
    for module, gains in ((BLOCK, True), ("Balloon", False), ("Sqr Balloon", False)):
        machine = built(("1", "E", BLOCK), catalogue=module_set("workshop"))
        assert attach(machine, "2", "E", module).ok
        trial = _flown(machine, climb=20.0)
        run = Run(scenario=scenario, machine=machine, trajectory=trial)
        assert gains_energy(run, 300) == gains, module


def test_a_cargo_that_grows_brings_energy(tasks, car) -> None:
    trial = _bridge(car, falls_at=99.0)
    for rise, gains in ((0.0, False), (0.2, True)):
        cargo = trial.cargo_position.copy()
        cargo[:, 2] += rise * np.maximum(trial.time_s - 8.0, 0.0)
        raised = replace(trial, cargo_position=cargo)
        run = Run(scenario=tasks["support-1"].scenario, machine=car, trajectory=raised)
        found = gains_energy(run, len(trial.time_s))
        assert found == gains
