"""Programs in the game: what they sense and press there, and what logs tell of it.

A runner of the game says that a program failed: its log shows it, or it is not believed.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.game.game_rig import AGENT, GO, drive, piloted, program
from support.game.record_games import RUN, Recorded, game_of, recorded
from support.lua_game import LuaGame
from support.machines.families import mechanism
from support.machines.trials import press

from buildarena_backend.errors import UploadError
from buildarena_backend.trials.trial_checks import require_refusable
from buildarena_benchmark import load_task, score
from buildarena_besiege import (
    GameLog,
    LogIncompleteError,
    MachineNotPlayableError,
    prepare_run,
    trajectory_of,
)
from buildarena_besiege.checksums import checksum
from buildarena_besiege.keys import channel_keys
from buildarena_besiege.run import prepared_machine
from buildarena_geometry import Machine
from buildarena_simulation import ControllerFailed, Scenario, Trajectory
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.scenario import Cargo, Gate, GroundPlacement, Gusts, Line, TerrainBox
from buildarena_simulation.sensor_config import Senses

pytestmark = pytest.mark.nightly

EXAMPLE = Path(__file__).parents[3] / "examples/control"


def read_back(game: LuaGame, machine: Machine, scenario: Scenario) -> Trajectory:
    log = GameLog(RUN)
    log.read("\n".join(reversed(game.lines)))
    assert not log.complaints
    return trajectory_of(log, machine, scenario, game="1", mod="1")


def tried(text: str, scenario: Scenario | None = None) -> tuple[LuaGame, Trajectory]:
    """A car that moves as the engine has it, and its program's answers in the game."""
    scenario, machine = scenario or drive(), piloted(text)
    game = game_of(recorded(machine, scenario), scenario)
    return game, read_back(game, machine, scenario)


@pytest.fixture(scope="module")
def to_the_mark() -> tuple[Machine, Scenario, Recorded, LuaGame]:
    """The example's car, on its way to the mark, without noise and delay."""
    document = json.loads((EXAMPLE / "car.machine.json").read_text(encoding="utf-8"))
    text = (EXAMPLE / "to-the-mark.lua").read_text(encoding="utf-8")
    machine = Machine.from_document(document).with_controller(text)
    scenario = load_task(EXAMPLE / "to-the-mark.yaml").scenario
    senses = scenario.senses.model_copy(update={"noise": {}, "delay_ticks": 0})
    scenario = scenario.model_copy(update={"senses": senses})
    run = recorded(machine, scenario)
    return machine, scenario, run, game_of(run, scenario)


def test_a_program_senses_and_answers_in_the_game_what_it_does_in_an_engine(to_the_mark) -> None:
    machine, scenario, run, game = to_the_mark
    ours, there = run.trajectory.piloting, read_back(game, machine, scenario).piloting
    assert there.sense_names == ours.sense_names
    assert there.action_names == ours.action_names
    apart = np.abs(there.senses - ours.senses)[:-1]
    assert np.median(apart, axis=0).max() < 0.01
    assert np.abs(there.answers - ours.answers).max() < 0.01
    task = replace(load_task(EXAMPLE / "to-the-mark.yaml"), scenario=scenario)
    assert score(task, machine, read_back(game, machine, scenario)).success


def changed(lines: list[str], kind: str, change) -> list[str]:
    """The lines, the hundredth of a kind changed and its sum made right; None leaves it out."""
    at = [k for k, line in enumerate(lines) if f",{kind}," in line][100]
    body = change(lines[at].rpartition(",")[0])
    return [*lines[:at], *([] if body is None else [f"{body},{checksum(body)}"]), *lines[at + 1 :]]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda body: body.rpartition(",")[0] + ",0.123456", "answered otherwise"),
        (lambda _: None, "lacks some of"),
    ],
)
def test_a_log_is_believed_if_its_program_answers_so_again(to_the_mark, change, words) -> None:
    machine, scenario, _, game = to_the_mark
    parts = [line for line in game.lines if ",p," in line]
    last = len({line.split(",")[4] for line in parts})
    lines = [line for line in game.lines if ",p," not in line]
    own = [line for line in parts if line.split(",")[4] == str(last)]
    others = [line for line in parts if line.split(",")[4] != str(last)]
    log = GameLog(RUN)
    log.read("\n".join([*lines, *others, *changed(own, "p", change)]) + "\n")
    with pytest.raises(LogIncompleteError, match=words):
        trajectory_of(log, machine, scenario, game="1", mod="1")


def test_all_kinds_of_joints_and_the_cargo_are_sensed_as_in_an_engine() -> None:
    text = 'sensors = { "12" }\n' + program(
        """return { spinning_forward = t > 0.5 and 0.6 or 0, turn_left = t > 1 and 0.5 or 0 }"""
    )
    machine = piloted(text, mechanism())
    cargo = Cargo(size=(1, 1, 1), drop_height=3.0, final_mass=2.0, ramp_s=1.0)
    scenario = Scenario(duration_s=3.0, control=AGENT, senses=Senses(), cargo=cargo)
    run = recorded(machine, scenario)
    there = read_back(game_of(run, scenario), machine, scenario).piloting
    ours = run.trajectory.piloting
    assert there.sense_names == ours.sense_names
    apart = np.median(np.abs(there.senses - ours.senses)[1:-1], axis=0)
    worst = dict(zip(ours.sense_names, apart.tolist(), strict=True))
    places = {name for name in worst if not name.endswith(("speed", "spin.x", "spin.y", "spin.z"))}
    assert max(worst[name] for name in places if "velocity" not in name) < 1e-3
    # Velocities are those of the way since the last look: what falls freely is 0.02 s behind.
    assert max(worst.values()) < 0.02 * GRAVITY
    assert np.array_equal(there.answers, ours.answers)


def keys_of(machine: Machine, action: str) -> list[str]:
    return [keys[action][0] for keys in channel_keys(machine).values() if action in keys]


def down(game: LuaGame, key: str, first: int, last: int) -> int:
    """In how many updates a key is down."""
    spans = game.held(key)
    return sum(max(0, min(end or 10**6, last) - max(start, first)) for start, end in spans)


def test_a_share_is_a_share_of_the_updates(subtests) -> None:
    for share in [0.0, 0.25, 1.0, 7.0]:
        with subtests.test(share=share):
            game, _ = tried(program(f"return {{ spinning_forward = {share} }}"))
            for key in keys_of(piloted(), "spinning_forward"):
                assert down(game, key, 1, 200) == pytest.approx(199 * min(share, 1), abs=1.01)
            assert all(not game.held(key) for key in keys_of(piloted(), "spinning_backward"))


def test_below_0_an_action_is_its_opposite_and_a_name_of_one_block_counts_alone() -> None:
    machine = piloted()
    one = next(block.id for block in machine.blocks.values() if block.module.motor)
    text = program(f'return {{ spinning_forward = -0.5, ["{one}.spinning_forward"] = 1 }}')
    game, trajectory = tried(text)
    keys = channel_keys(machine)
    for block, actions in keys.items():
        if not actions:
            continue
        forward, backward = (down(game, actions[f"spinning_{w}"][0], 1, 200)
                             for w in ("forward", "backward"))  # fmt: skip
        assert (forward, backward) == (199, 0) if block == one else (0, 99)
    assert f"{one}.spinning_backward" not in trajectory.piloting.action_names


def test_a_program_that_fails_lets_go_of_all_keys_and_its_log_says_why(subtests) -> None:
    for body, words in [
        ("if t >= 1 then local x = sense.nothing.x end", "line 2, tick 25 (1.00 s): attempt to"),
        ("return { spinning = 1 }", "there is no action 'spinning'; there is spinning_forward"),
        ("return 5", "tick 0 (0.00 s): it answers a number"),
        ("return { spinning_forward = 0 / 0 }", "is no number"),
        ("return { spinning_forward = 'x' }", "is a string"),
    ]:
        with subtests.test(body=body):
            text = program(body + "\nif t < 1 then return { spinning_forward = 0.3 } end")
            if body.startswith("return"):
                text = program(body)
            machine, scenario = piloted(text), drive()
            run = recorded(piloted(), scenario)  # moves as another, and runs this one's script
            own = replace(run, prepared=prepared_machine(machine, scenario, run_id=RUN))
            game = game_of(own, scenario)
            assert sum(",f," in line for line in game.lines) >= 1
            assert all(not calls or not calls[-1][1] for calls in game.calls.values())
            with pytest.raises(ControllerFailed) as caught:
                read_back(game, machine, scenario)
            assert words in caught.value.reason


BOX = TerrainBox(center=(0, 9, 0.5), size=(4, 4, 1))
REFUSED = {
    "no senses": (Scenario(duration_s=2, control=AGENT), "offers no senses"),
    "gusts": (drive(gusts=Gusts(strength=3)), "has no gusts"),
    "contacts": (drive(senses=Senses(offers=("axes", "contacts"))), "does not tell what touches"),
    "heading": (drive(placement=GroundPlacement(heading_deg=30)), "face north at the start"),
    "lean": (drive(placement=GroundPlacement(tilt_deg=3)), "do not lean at the start"),
    "line": (drive(line=Line(radius=11)), "has no line on the ground"),
    "contact on terrain": (drive(terrain=(BOX,)), r"wheels\[…\].contact, which the game tells on"),
}


def test_what_the_game_cannot_tell_or_do_is_refused(subtests) -> None:
    for scenario, words in REFUSED.values():
        refused = pytest.raises((MachineNotPlayableError, ControllerFailed), match=words)
        with subtests.test(scenario=scenario), refused:
            prepare_run(piloted(), scenario, name="m", run_id="r")


def test_a_program_that_cannot_be_read_is_refused_when_it_is_exported() -> None:
    with pytest.raises(ControllerFailed, match=r"line 2: programs are Lua 5\.2"):
        prepare_run(piloted(program("local x = 1 // 2")), drive(), name="m", run_id="r")


def test_more_actions_than_keys_are_refused() -> None:
    machine = piloted()
    wheel = next(block for block in machine.blocks.values() if block.module.motor)
    blocks = dict(machine.state.blocks)
    for number in range(1000, 1100):
        blocks[str(number)] = replace(wheel, id=str(number))
    many = machine.restored(replace(machine.log, state=replace(machine.state, blocks=blocks)))
    with pytest.raises(MachineNotPlayableError, match="has 184 keys for them"):
        channel_keys(many)


def test_the_gate_that_is_told_is_the_next_one() -> None:
    gates = [Gate(name=f"gate {y}", center=(x, y), half_width=2) for x, y in ((1, 1), (2, 9))]
    scenario = drive(senses=Senses(offers=("pose", "gate")), gates=gates)
    _, trajectory = tried(program("return { spinning_forward = 1 }"), scenario)
    names, senses = trajectory.piloting.sense_names, trajectory.piloting.senses[:-1]
    own, place = (senses[:, names.index(f"{name}position.y")] for name in ("", "gate."))
    assert {1.0, 9.0} == set(place.tolist())
    assert np.all(place == np.where(own < 1, 1.0, 9.0))


FAILS = program("return t < 1 and { spinning_forward = 0.3 } or sense.nothing.here")
"""It fails at 1 s."""
NAMED = {"run": RUN, "game": "1", "mod": "1"}


@pytest.fixture(scope="module")
def logs() -> dict[str, bytes]:
    """What the game prints of the car with a program, by the program."""
    scenario = drive()
    run = recorded(piloted(), scenario)
    games = {}
    for text in (FAILS, GO):
        prepared = prepared_machine(piloted(text), scenario, run_id=RUN)
        game = game_of(replace(run, prepared=prepared), scenario)
        games[text] = "\n".join(game.lines).encode()
    return games


def refusable(text: str, log: bytes | None, **more) -> None:
    """Whether a runner of the game is believed that a program failed."""
    machine = more.pop("machine", piloted(text))
    given = {"controls": more.pop("controls", None), "versions": {**NAMED, **more}, "log": log}
    require_refusable(simulator="besiege", machine=machine, scenario=drive(), **given)


FAILED = (
    "the controller failed, line 2, tick 25 (1.00 s): "
    "attempt to index field 'nothing' (a nil value)"
)


def test_a_program_that_failed_in_the_game_is_believed_by_its_log(logs) -> None:
    refusable(FAILS, logs[FAILS], refused=FAILED)


@pytest.mark.nightly(keep=3)
@pytest.mark.parametrize(
    ("text", "log", "more", "words"),
    [
        (FAILS, None, {}, "does not refuse this machine"),
        (GO, GO, {}, "does not refuse this machine"),
        (GO, FAILS, {}, "another machine"),
        (FAILS, FAILS, {"refused": FAILED.replace("line 2", "line 3")}, "refused is not: the con"),
        (FAILS, FAILS, {"refused": None}, "refused is not: the controller failed, line 2"),
        (FAILS, FAILS, {"run": "another"}, "the log does not describe the trial"),
        (FAILS, FAILS, {"controls": [press("UpArrow", 0.5, 1.0)]}, "does not refuse this machine"),
    ],
)
def test_a_failure_that_the_log_does_not_tell_is_not_believed(logs, text, log, more, words) -> None:
    with pytest.raises(UploadError, match=words):
        refusable(text, logs.get(log), **{"refused": FAILED, **more})
