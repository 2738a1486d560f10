"""Controllers in trials: what they sense, what they set in motion, and that it is repeatable."""

from dataclasses import replace
from hashlib import sha256

import numpy as np
import pytest
from support.machines.building import KeyedDraft
from support.machines.families import car, rocket
from support.machines.trials import press

from buildarena_benchmark import broken_constraint
from buildarena_benchmark.experts.drafting import EAST, NORTH, UP
from buildarena_simulation import (
    ControllerFailed,
    Scenario,
    read_trajectory,
    schema_of,
    simulate,
    write_trajectory,
)
from buildarena_simulation.control import read_presses
from buildarena_simulation.scenario import Cargo, Control, Drift, Gate, Mark
from buildarena_simulation.sensor_config import Senses

AGENT = Control(mode="agent")
SERIES = ("time_s", "positions", "quaternions", "heated", "pieces", "joint_loads")
GO = "function control() return { spinning_forward = 1 } end"


def drive(duration_s: float = 4.0, **changes) -> Scenario:
    return Scenario(duration_s=duration_s, control=AGENT, senses=Senses(), **changes)


def driven(program: str, scenario: Scenario | None = None, engine: str = "mujoco", **more):
    machine = more.pop("machine", None) or car(drive=())
    return simulate(machine.with_controller(program), scenario or drive(), engine, **more)


def words_of(program: str, scenario: Scenario | None = None, engine="mujoco", **more) -> str:
    """With which words a program fails."""
    with pytest.raises(ControllerFailed) as caught:
        driven(program, scenario, engine, **more)
    return caught.value.reason.split(": ", 1)[1]


def told(sense: str, scenario: Scenario | None = None, engine="mujoco") -> str:
    """A sense in the middle of a trial, as the message with which its program fails."""
    program = f"function control(t, sense) if t >= 1 then error('' .. {sense}) end return {{}} end"
    return words_of(program, scenario, engine)


def test_a_program_without_senses_drives_as_the_keys_do(engine) -> None:
    keys = [press("UpArrow", 1.0, 2.0)]
    by_keys = simulate(car(drive=()), drive(), engine, controls=keys)
    program = "function control(t) return { spinning_forward = t >= 1 and t < 3 and 1 or 0 } end"
    by_program = driven(program, engine=engine)
    assert np.array_equal(by_program.positions, by_keys.positions)
    assert by_program.settings["controller"] == sha256(program.encode()).hexdigest()
    presses = read_presses(str(by_program.settings["presses"]))
    assert {hold.key.split(".")[1] for hold in presses} == {"spinning_forward"}
    assert {(hold.time_s, hold.hold_for_s) for hold in presses} == {(1.0, 2.0)}


def test_a_share_is_a_share_of_the_speed(engine) -> None:
    far = [
        driven(GO.replace("1", share), engine=engine).positions[-1, 0, 1]
        for share in ("1", "0.5", "-0.5")
    ]
    assert far[1] == pytest.approx(0.5 * far[0], rel=0.15)
    assert far[2] == pytest.approx(-far[1], rel=0.05)
    beyond = driven(GO.replace("1", "9"), engine=engine)
    assert beyond.positions[-1, 0, 1] == pytest.approx(far[0])


def test_a_name_of_one_block_counts_in_place_of_all() -> None:
    wheels = [block.id for block in car().blocks.values() if block.module.motor]
    still = ", ".join(f'["{wheel}.spinning_forward"] = 0' for wheel in wheels)
    parked = driven(f"function control() return {{ spinning_forward = 1, {still} }} end")
    assert abs(parked.positions[-1, 0, 1]) < 0.2


def test_a_block_that_is_listed_tells_where_it_is(engine) -> None:
    program = "sensors = { 7 } function control(t, s) error('' .. s.blocks['7'].position.x) end"
    assert float(words_of(program, engine=engine)) == pytest.approx(1.5)


def test_wheels_tell_their_speed_and_what_they_touch(engine) -> None:
    wheel = next(block.id for block in car().blocks.values() if block.module.motor)
    program = f"""
    function control(t, sense)
      local own = sense.wheels['{wheel}']
      if t >= 2 then error(own.speed .. ' ' .. own.contact) end
      return {{ spinning_forward = 0.5 }}
    end
    """
    speed, contact = map(float, words_of(program, engine=engine).split())
    motor = car().blocks[wheel].module.motor
    assert speed == pytest.approx(0.5 * motor.speed, rel=0.1)
    assert contact == 1.0


def test_joints_tell_their_angle_and_drives_hold_what_was_asked_for(engine) -> None:
    draft = KeyedDraft(modules="workshop")
    base = draft.start()
    for way in (NORTH, EAST):
        draft.row(base, way, 2)
    hinge = draft.attach(base, UP, "Steering Hinge")
    machine = draft.machine
    drive_of = machine.blocks[hinge].module.joint.drive
    program = f"""
    function control(t, sense)
      local joint = sense.joints['{hinge}']
      if t >= 2 then error(joint.angle .. ' ' .. joint.speed) end
      return {{ {drive_of.forward} = joint.angle < 0.3 and 0.5 or 0 }}
    end
    """
    angle, speed = map(float, words_of(program, engine=engine, machine=machine).split())
    assert angle == pytest.approx(0.3, abs=0.05)
    assert abs(speed) < 1.0


def test_cargo_marks_and_gates_are_told_from_where_it_is() -> None:
    scenario = drive(
        2.0,
        cargo=Cargo(size=(1, 1, 1), final_mass=5.0, ramp_s=1.0, at=(6, 0, 0)),
        marks=(Mark(name="goal", center=(3, 4, 0), radius=1),),
        gates=(Gate(name="first", center=(0, 9), half_width=2),),
    )
    for sense, value in (
        ("cargo.relative.x", 6.0),
        ("marks.goal.position.y", 4.0),
        ("gates.first.relative.y", 9.0),
    ):
        assert float(told(f"sense.{sense}", scenario=scenario)) == pytest.approx(value, abs=0.1)


def test_the_next_gate_is_the_first_one_to_the_north() -> None:
    gates = [
        Gate(name=f"gate {y}", center=(x, y), half_width=2) for x, y in ((1, -3), (2, 4), (3, 9))
    ]
    offered = Senses(offers=("pose", "gate"))
    scenario = Scenario(duration_s=2.0, control=AGENT, senses=offered, gates=gates)
    assert float(told("sense.gate.position.x", scenario=scenario)) == 2.0
    assert float(told("sense.gate.relative.y", scenario=scenario)) == pytest.approx(4.0, abs=0.1)
    past = scenario.model_copy(update={"gates": gates[:1]})
    assert float(told("sense.gate.position.y", scenario=past)) == -3.0
    assert "index field 'gates'" in told("sense.gates['gate 4'].position.y", scenario=scenario)


def test_a_mark_that_moves_is_told_where_it_is_then(engine) -> None:
    drift = Drift(swing=(4, -2, 1), period_s=(16, 8, 4))
    mark = Mark(name="goal", center=(3, 4, 5), radius=1, drift=drift)
    still = "function control() return {} end"
    trajectory = driven(still, drive(2.0, marks=(mark,)), engine)
    piloting = trajectory.piloting
    place, relative = (
        piloting.senses[:-1, piloting.sense_names.index(f"marks.goal.{name}")]
        for name in ("position.x", "relative.y")
    )
    times = trajectory.time_s[:-1]
    assert mark.at(0.0) == (3, 4, 5)
    np.testing.assert_allclose(place, 3 + 4 * np.sin(np.pi * times / 8), atol=2e-6)
    own = trajectory.positions[:-1, 0, 1]
    np.testing.assert_allclose(relative, 4 - 2 * np.sin(np.pi * times / 4) - own, atol=1e-4)


def test_a_task_offers_what_it_says_and_no_more() -> None:
    kinds = {"pose": "position", "blocks": "blocks", "joints": "joints", "wheels": "wheels"}
    for kind, name in kinds.items():
        senses = Senses(offers=tuple(other for other in kinds if other != kind))
        scenario = drive().model_copy(update={"senses": senses})
        assert "nil" in words_of(f"function control(t, s) return s.{name}.x end", scenario)


def test_noise_is_drawn_from_the_seed_and_delay_counts_ticks() -> None:
    def heights(seed: int | None, **senses) -> list[float]:
        seen = """
        local seen = {}
        function control(t, sense)
          seen[#seen + 1] = sense.position.z
          if #seen == 9 then error(table.concat(seen, ' ')) end
        end
        """
        offered = drive().model_copy(update={"senses": Senses(**senses)})
        return [float(word) for word in words_of(seen, offered, seed=seed).split()]

    exact, noisy = heights(None), heights(None, noise={"place": 0.5})
    assert noisy == heights(None, noise={"place": 0.5}) != exact
    assert noisy != heights(1, noise={"place": 0.5})
    assert 0.1 < np.std(np.subtract(noisy, exact)) < 1.5
    late = heights(None, delay_ticks=3)
    assert late == [exact[0]] * 3 + exact[:6]


def test_a_failure_says_when_it_was() -> None:
    with pytest.raises(ControllerFailed, match=r"line 1, tick 26 \(1\.04 s\)"):
        driven("function control(t) return t > 1 and nothing.x or {} end")


def test_what_touches_is_told_of_the_blocks_that_are_listed(engine) -> None:
    machine = car(drive=())
    wheel = next(block.id for block in machine.blocks.values() if block.module.spins)
    program = (
        f"sensors = {{ '1', '{wheel}' }} function control(t, sense) if t >= 1 then "
        f"error(sense.contacts['1'] .. ' ' .. sense.contacts['{wheel}']) end return {{}} end"
    )
    senses = Senses(offers=("axes", "contacts"))
    scenario = Scenario(duration_s=2.0, control=AGENT, senses=senses)
    assert words_of(program, scenario, engine, machine=machine) == "0 1"


def test_sensors_are_blocks_of_the_machine() -> None:
    with pytest.raises(ControllerFailed, match="sensors names block 'x'; the machine has 1, 2, 3"):
        driven("sensors = { 'x' } function control() end")


def test_fire_takes_shares(engine) -> None:
    ship = rocket()
    (action, *_) = {b.module.thrust.action for b in ship.blocks.values() if b.module.thrust}
    rises = []
    for share in (0, 0.7, 1):
        program = f"function control() return {{ {action} = {share} }} end"
        rises.append(driven(program, drive(3.0), engine, machine=ship).positions[:, 0, 2].max())
    assert rises == sorted(rises)
    assert rises[2] > rises[0] + 1


def test_a_task_without_senses_takes_no_controller(tasks) -> None:
    machine = car().with_controller(GO)
    broken = broken_constraint(tasks["transport-1"], machine)
    assert broken is not None
    assert broken[0] == "constraint_violated"
    assert "it takes keys alone" in broken[1]
    with pytest.raises(ControllerFailed, match="it takes keys alone"):
        simulate(machine, tasks["transport-1"].scenario, "mujoco")


def test_a_trajectory_keeps_what_was_sensed_and_asked_for_at_each_tick(engine) -> None:
    machine = car(drive=())
    wheel = next(block.id for block in machine.blocks.values() if block.module.spins)
    program = f"""function control(t, sense)
      return {{ spinning_forward = t / 4, ["{wheel}.spinning_forward"] = t > 1 and -0.5 or 0 }}
    end"""
    whole = driven(program, drive(2.04), engine, machine=machine)
    piloting, start = whole.piloting, whole.block_ids.index("1")
    names = piloting.sense_names
    assert len(set(names)) == len(names)
    assert {"position.x", "up.z", f"wheels.{wheel}.contact"} <= set(names)
    for axis, name in enumerate("xyz"):
        sensed = piloting.senses[:-1, names.index(f"position.{name}")]
        assert sensed == pytest.approx(whole.positions[:-1, start, axis], abs=1e-3)
    for name in ("up.z", "forward.y"):
        assert piloting.senses[:-1, names.index(name)] == pytest.approx(1.0, abs=0.01)
    assert np.isnan(piloting.senses[-1]).all()
    asked = dict(zip(piloting.action_names, piloting.answers.T, strict=True))
    own = f"{wheel}."
    others = [name for name in asked if not name.startswith(own)]
    assert {name.partition(".")[2] for name in others} == {"spinning_forward"}
    for name in others:
        assert asked[name][:-1] == pytest.approx(whole.time_s[:-1] / 4)
    assert asked[own + "spinning_backward"][40] == 0.5
    assert not asked[own + "spinning_backward"][:25].any()
    assert not piloting.answers[-1].any()


def test_files_of_piloted_trials_have_it_and_others_are_as_before() -> None:
    piloted = driven(GO, drive(1.0))
    data = write_trajectory(piloted)
    again = read_trajectory(data)
    assert schema_of(data) == 4
    assert again.piloting.sense_names == piloted.piloting.sense_names
    assert again.piloting.action_names == piloted.piloting.action_names
    assert np.array_equal(again.piloting.senses, piloted.piloting.senses, equal_nan=True)
    assert np.array_equal(again.piloting.answers, piloted.piloting.answers)
    assert write_trajectory(again) == data
    assert read_trajectory(write_trajectory(piloted, schema=3)).piloting is None
    by_keys = simulate(car(drive=()), drive(1.0), "mujoco", controls=[press("UpArrow", 0.0, 1.0)])
    assert by_keys.piloting is None
    assert schema_of(write_trajectory(by_keys)) == 3
    with pytest.raises(ValueError, match="piloting has 26 instants, not 25"):
        replace(piloted, **{name: getattr(piloted, name)[:25] for name in SERIES}, bearing=None)
