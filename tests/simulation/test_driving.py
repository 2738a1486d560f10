"""Keys, heat, and trials that somebody outside drives: the same bytes, one or many."""

import gc
import math
from dataclasses import replace

import numpy as np
import pytest
from support.machines.building import KeyedDraft
from support.machines.families import car, rocket
from support.machines.references import REFERENCES, load_machine
from support.machines.trials import press

from buildarena_benchmark.experts.drafting import DOWN, EAST, UP
from buildarena_geometry import KeyPress, Machine, load_catalogue
from buildarena_geometry.flames import heating
from buildarena_simulation import (
    ControllerFailed,
    Drive,
    MachineNotSimulable,
    Play,
    Scenario,
    Trajectory,
    UnknownEngineError,
    pilot_of,
    simulate,
    simulate_many,
    write_trajectory,
)
from buildarena_simulation.control import Drives, heated_cannons, key_levels, plan_schedule
from buildarena_simulation.controllers.program import Program
from buildarena_simulation.engines.base import Engine
from buildarena_simulation.machine import bindings_of, structure_of
from buildarena_simulation.scenario import Control, Gate, SpanPlacement
from buildarena_simulation.sensor_config import Senses

MOTOR = load_catalogue()["Powered Wheel"].motor


WHEEL_SPEED, WHEEL_LAG_RATE = MOTOR.speed, MOTOR.lag_per_s


def _speeds_of(machine: Machine, *keys: KeyPress) -> np.ndarray:
    structure, times = structure_of(machine), 0.01 * np.arange(300)
    return plan_schedule(
        structure,
        key_levels(bindings_of(machine), keys, times),
        Drives(structure, 0.01),
        control=Control(mode="agent"),
        times=times,
    ).targets


def test_a_wheel_follows_its_key_with_a_lag() -> None:
    speeds = np.abs(_speeds_of(car(), press("UpArrow", 0.5, 1.0))[:, 0])
    assert (speeds[:50] == 0.0).all()
    reached = WHEEL_SPEED * (1 - math.exp(-WHEEL_LAG_RATE * 0.1))
    assert speeds[59] == pytest.approx(reached)
    assert speeds[149] == pytest.approx(WHEEL_SPEED, rel=1e-3)
    assert speeds[299] < 0.01


def test_keys_for_both_directions_brake() -> None:
    both = press("UpArrow", 0.0, 3.0), press("DownArrow", 0.0, 3.0)
    assert (_speeds_of(car(), *both) == 0.0).all()


def test_given_controls_replace_the_machines_own(tasks) -> None:
    scenario = tasks["transport-1"].scenario.model_copy(update={"duration_s": 2.0})
    machine = car(drive=())
    keys = (press("UpArrow", 0.0, 2.0), press("Alpha9", 0.0, 1.0))
    trajectory = simulate(machine, scenario, "mujoco", controls=keys)
    assert trajectory.positions[-1, 0, 1] > 10.0
    assert trajectory.settings["effective_key_presses"] == 1


def _heated(flame: tuple[float, float, float]) -> bool:
    """Whether a flame heats a cannon at the origin that sprays down."""
    structure = structure_of(rocket((EAST,)))
    shown = np.zeros((len(structure), 3))
    directions = np.zeros((len(structure), 3))
    directions[structure.cannons] = DOWN
    directions[structure.torches] = UP
    shown[structure.torches] = np.array(flame) - UP
    return bool(heated_cannons(structure, shown, directions)[0])


def test_a_cannon_is_heated_in_the_simulation_if_its_builder_was_told_so() -> None:
    for name in REFERENCES:
        machine = load_machine(name)
        structure = structure_of(machine)
        directions = np.zeros((len(structure), 3))
        for row, part in enumerate(structure.parts):
            if part.direction is not None:
                directions[row] = part.direction
        simulated = heated_cannons(structure, structure.shown, directions)
        ids = [structure.block_ids[row] for row in structure.cannons]
        told = {cannon: bool(torches) for cannon, torches in heating(machine.state).items()}
        assert told == dict(zip(ids, simulated.tolist(), strict=True)), name


def test_a_flame_heats_what_it_touches_and_a_small_one_at_the_waist_misses() -> None:
    waist = -0.125
    for place, heats in {
        (0.0, 0.0, -1.0): True,  # the outlet
        (0.0, 0.0, 0.75): True,  # the inlet
        (0.79, 0.0, -0.5): True,
        (0.81, 0.0, -0.5): False,
        (0.0, 0.0, -1.31): False,
        (0.75, 0.0, waist): False,
        (0.7, 0.0, waist): True,
        (0.75, 0.0, waist - 0.375): True,
    }.items():
        assert _heated(place) == heats, place


def test_a_rope_does_not_push(engine) -> None:
    draft = KeyedDraft()
    low = draft.start()
    middle, high = draft.row(low, UP, 2)
    draft.connect(low, high, UP, DOWN, connector="Winch")
    draft.do("remove_block", block_id=middle)
    scenario = Scenario(duration_s=2.0, placement=SpanPlacement(gap=1.0, lowest_center=0.6))
    trajectory = simulate(draft.machine, scenario, engine)
    # The upper block has come down on the lower one, or beside it.
    assert trajectory.positions[-1, 1, 2] < 2.0


WEAVING = """
function control(t, sense)
  local turn = 0.4 * math.sin(2 * t) - 0.1 * sense.spin.z + 0.02 * math.random()
  return { spinning_forward = 0.8 + turn, ["7.spinning_forward"] = 0.8 - turn }
end
"""


SHORT = Scenario(
    duration_s=2.0,
    control=Control(mode="agent"),
    gates=[Gate(name="goal", center=(1, 8), half_width=2)],
    senses=Senses(noise={"place": 0.05, "spin": 0.02}, delay_ticks=2),
)


@pytest.fixture
def listening(monkeypatch) -> list[dict[str, float]]:
    """What programs answer from now on."""
    answers: list[dict[str, float]] = []
    answer = Program.answer

    def listened(program: Program, *tick) -> dict[str, float]:
        answers.append(answer(program, *tick))
        return answers[-1]

    monkeypatch.setattr(Program, "answer", listened)
    return answers


def to_the_end(drive: Drive, answers) -> Trajectory:
    for answer in answers:
        drive.step(answer)
    assert drive.is_over
    return drive.trajectory()


def written(trajectory: Trajectory) -> bytes:
    """The whole of it, but for which program acted."""
    settings = {name: value for name, value in trajectory.settings.items() if name != "controller"}
    return write_trajectory(replace(trajectory, settings=settings))


def wheels() -> dict[str, float]:
    return dict.fromkeys(pilot_of(car(drive=()), SHORT).axes, 0.7)


def test_the_answers_of_a_program_make_the_same_trial(engine, listening) -> None:
    machine, seed = car(drive=()), 11
    program = simulate(machine.with_controller(WEAVING), SHORT, engine, seed=seed)
    assert len(listening) == 50
    driven = to_the_end(Drive(machine, SHORT, engine, seed=seed), listening)
    assert written(driven) == written(program)
    assert "controller" not in driven.settings
    assert "piloting" not in driven.settings
    assert driven.piloting is not None


def test_trials_side_by_side_do_not_touch_each_other(engine) -> None:
    machine, answers = car(drive=()), wheels()
    alone = [
        written(to_the_end(Drive(machine, SHORT, engine, seed=seed), [answers] * 50))
        for seed in (1, 2)
    ]
    drives = [Drive(machine, SHORT, engine, seed=seed) for seed in (1, 2)]
    for _ in range(50):
        for drive in drives:
            drive.step(answers)
    assert [written(drive.trajectory()) for drive in drives] == alone
    assert alone[0] != alone[1]


WRONG = [
    ({"spinning_forwards": 1.0}, "there is no action 'spinning_forwards'; there is spinning_"),
    ({"99.fly": 1.0}, "there is no action '99.fly'"),
    ({"spinning_forward": float("nan")}, "what it answers for spinning_forward is no number"),
]


def test_a_wrong_answer_is_refused_and_nothing_passes() -> None:
    good = wheels()
    whole = to_the_end(Drive(car(drive=()), SHORT, "mujoco"), [good] * 50)
    drive = Drive(car(drive=()), SHORT, "mujoco")
    for tick in range(50):
        answers, words = WRONG[tick % len(WRONG)]
        with pytest.raises(ControllerFailed, match=words):
            drive.step(answers)
        drive.step(good)
    assert written(drive.trajectory()) == written(whole)
    with pytest.raises(ValueError, match="the trial is over"):
        drive.step({})
    # Of two opposites the forward one, with both ways in it.
    pilot = pilot_of(car(drive=()), SHORT)
    assert {name.partition(".")[2]: low for name, low in pilot.axes.items()} == {
        "spinning_forward": -1.0
    }


def test_an_abandoned_trial_ends_its_world(monkeypatch) -> None:
    ended = []
    drive = Drive(car(drive=()), SHORT, "mujoco")
    close = type(drive._rollout._adapter).close
    monkeypatch.setattr(
        type(drive._rollout._adapter), "close", lambda engine: (ended.append(1), close(engine))
    )
    abandoned = Drive(car(drive=()), SHORT, "mujoco")
    drive.close()
    del abandoned
    gc.collect()
    assert ended == [1]


def test_a_machine_that_blows_up_ends_the_trial_there(engine, monkeypatch) -> None:
    drive = Drive(car(drive=()), SHORT, engine)
    kind: type[Engine] = type(drive._rollout._adapter)
    for _ in range(10):
        drive.step(wheels())
    before, motion = list(drive.senses), kind.motion

    def exploding(engine: Engine):
        now = motion(engine)
        return replace(now, position=now.position * np.nan)

    monkeypatch.setattr(kind, "motion", exploding)
    drive.step(wheels())
    assert drive.is_cut
    assert drive.is_over
    assert drive.senses == before
    cut = drive.trajectory()
    assert np.isfinite(cut.positions[:11]).all()
    assert np.isnan(cut.positions[11:]).any(axis=(1, 2)).all()
    assert len(cut.time_s) == len(cut.piloting.senses) == 51


def test_trials_without_senses_cannot_be_driven() -> None:
    for scenario in (
        SHORT.model_copy(update={"senses": None}),
        SHORT.model_copy(update={"control": Control(mode="constant")}),
    ):
        with pytest.raises(ControllerFailed, match="offers no senses"):
            Drive(car(drive=()), scenario, "mujoco")
    with pytest.raises(UnknownEngineError, match="no engine 'game'"):
        Drive(car(drive=()), SHORT, "game")


SHORT_S = 2.6
"""Long enough for the beam's cargo to land, and for the carrier to drive off."""


def bytes_of(outcome: Trajectory | MachineNotSimulable) -> bytes:
    assert isinstance(outcome, Trajectory), outcome
    return write_trajectory(outcome)


def test_each_trial_of_many_has_the_bytes_of_one_by_itself(engine, tasks) -> None:
    machine = load_machine("carrier")
    scenario = tasks["transport-2"].scenario.model_copy(update={"duration_s": SHORT_S})
    pressed = (KeyPress(time_s=0.4, key="UpArrow", hold_for_s=0.8),)
    plays = [Play(seed=3), Play(), Play(seed=4), Play(controls=pressed), Play(seed=3)]
    many = [bytes_of(each) for each in simulate_many(machine, scenario, engine, plays=plays)]
    alone = [
        bytes_of(simulate(machine, scenario, engine, seed=play.seed, controls=play.controls))
        for play in plays
    ]
    assert many == alone
    assert many[0] == many[4]
    assert len(set(many)) > 2


def test_a_program_starts_anew_in_each_trial(engine) -> None:
    text = "local n = 0\nfunction control() n = n + 1 return { spinning_forward = n < 20 } end"
    machine = car().with_controller(text)
    scenario = Scenario(duration_s=1.0, control=Control(mode="agent"), senses=Senses())
    first, second, third = (
        bytes_of(each)
        for each in simulate_many(
            machine, scenario, engine, plays=[Play(), Play(controls=()), Play()]
        )
    )
    assert first == third == write_trajectory(simulate(machine, scenario, engine))
    assert first != second


def test_a_refused_trial_is_told_and_the_next_ones_go_on(engine, tasks) -> None:
    scenario = Scenario(duration_s=0.4, control=Control(mode="agent"), senses=Senses())
    machine = car().with_controller("function control() error('no') end")
    refused, driven = simulate_many(machine, scenario, engine, plays=[Play(), Play(controls=())])
    assert isinstance(refused, MachineNotSimulable)
    assert isinstance(driven, Trajectory)
    plays = [Play(seed=1), Play(seed=2)]
    empty = list(simulate_many(Machine(), tasks["lift-1"].scenario, engine, plays=plays))
    assert [str(each) for each in empty] == ["the machine has no blocks"] * 2
