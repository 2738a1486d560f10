"""Scripts do in every Lua what the published ones do, and say which level was open."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.lua_game import VERSIONS
from support.machines.building import attach
from tests.besiege.golden import goldens, scenario_of
from tests.besiege.playing import log_of, played, press, vehicle

from buildarena_benchmark import builtin_tasks
from buildarena_besiege import (
    LogIncompleteError,
    MachineNotPlayableError,
    prepare_run,
    trajectory_of,
)
from buildarena_besiege.checksums import checksum
from buildarena_besiege.exporting.probes import MAX_PROBES, height_at, level_probes
from buildarena_besiege.exporting.script import lua_text
from buildarena_besiege.keys import key_edges
from buildarena_besiege.tracking import tracked_blocks
from buildarena_simulation import Scenario
from buildarena_simulation.scenario import TerrainBox

TASKS = builtin_tasks()
SHORT = TASKS["transport-2"].scenario.model_copy(update={"duration_s": 2.0})


def in_order_of_time(presses) -> bool:
    times = [one.time_s for one in presses]
    return times == sorted(times)


def test_keys_and_slider_are_those_of_the_published_script(subtests) -> None:
    """Of every third machine one drive with its keys, and one other trial."""
    for found in goldens()[::3]:
        trials = [e for e in found.exports if not e["refused"] and e["category"] != "plain"]
        for drives in (True, False):
            for export in [e for e in trials if (e["category"] == "transport") == drives][-1:]:
                with subtests.test(found.name, category=export["category"]):
                    assert_played_alike(found, export)


def assert_played_alike(found, export) -> None:
    machine, presses = found.played(export)
    game = played(machine, scenario_of(export), controls=presses)
    theirs = {key: one["held"] for key, one in export["lua"]["keys"].items() if one["held"]}
    if in_order_of_time(presses):
        assert {key: game.held(key) for key in game.calls if game.held(key)} == theirs
    ours = {n: (name, value) for n, name, value in game.slider}
    assert len(game.slider) == export["lua"]["slider_calls"]
    for n, _, name, value in export["lua"]["slider"]:
        assert ours[n] == (name, pytest.approx(value, abs=1e-9))


def test_every_lua_prints_the_same(subtests) -> None:
    for version in VERSIONS:
        for task in ["transport-3", "support-1", "lift-1", "lift-3"]:
            with subtests.test(version=version, task=task):
                scenario = TASKS[task].scenario.model_copy(update={"duration_s": 6.0})
                machine = vehicle(cannon=True)
                lines = played(machine, scenario, version=version, updates=660).lines
                assert lines == played(machine, scenario, version="lua54", updates=660).lines
                assert lines[0].startswith("ba,run-1,b,")
                ends = [line.split(",")[2:4] for line in lines[-3:]]
                assert ends == [["e", "600"], ["e", "625"], ["e", "650"]]


def test_lines_hold_their_sums_and_at_most_eight_blocks() -> None:
    machine = vehicle()
    for _ in range(12):
        last = str(machine.state.next_id - 1)
        face = "E"
        assert attach(machine, last, face).ok
    lines = played(machine, Scenario(duration_s=2.0)).lines
    samples = [line.split(",") for line in lines if ",s," in line]
    assert {(one[4], one[5]) for one in samples} == {("1", "2"), ("2", "2")}
    assert {len(one) for one in samples} == {6 + 8 * 5 + 1}
    assert all(checksum(line.rpartition(",")[0]) == int(line.rpartition(",")[2]) for line in lines)
    assert max(map(len, lines)) < 500


def test_positions_have_four_decimals_whatever_their_size() -> None:
    paths = {0: (1.00004, -0.00006, 199999.99996), 2: (-0.5, 0.0, -12345.67891)}
    paths[1] = (float("nan"), float("inf"), -1e12)
    scenario = Scenario(duration_s=2.0, tracked_blocks=("1", "2", "3"))
    game = played(vehicle(), scenario, path=lambda i, _: paths.get(i, (0.0, 0.0, 0.0)))
    fields = next(line for line in game.lines if ",s," in line).split(",")
    assert fields[8:11] == ["1.0000", "-0.0001", "200000.0000"]
    assert fields[13:16] == ["nan", "nan", "nan"]
    assert fields[18:21] == ["-0.5000", "0.0000", "-12345.6789"]


KEYS = st.sampled_from(["UpArrow", "Alpha2"])
HOLDS = st.floats(0.001, 4) | st.sampled_from([0.1, 0.5, 1.0])
PRESSES = st.lists(st.builds(press, st.floats(0, 12), KEYS, HOLDS), max_size=8)


def union(presses, key) -> set[int]:
    """The updates during which some hold of the key lasts, its ends rounded to a tenth."""
    down: set[int] = set()
    for one in presses:
        if one.key == key:
            start = round(float(f"{one.time_s:.1f}") * 100)
            end = round(float(f"{one.time_s + one.hold_for_s:.1f}") * 100)
            down |= set(range(max(start, 1), end))
    return down


@given(PRESSES)
@settings(max_examples=60, deadline=None)
def test_a_key_is_down_while_some_hold_of_it_lasts(presses) -> None:
    game = played(vehicle(), SHORT, controls=presses, updates=1700)
    for key in ("UpArrow", "Alpha2"):
        down = {n for start, end in game.held(key) for n in range(start, end or 1701)}
        assert down == union(presses, key)
        changes = [now for _, now in game.calls.get(key, [])]
        assert changes == [i % 2 == 0 for i in range(len(changes))], "one call for each edge"


def test_unknown_keys_are_refused_with_the_known_ones(subtests) -> None:
    for key in ['x") os.exit("', "Alpha10", "", "alpha1\n"]:
        refused = pytest.raises(MachineNotPlayableError, match="the keys are UpArrow, DownArrow")
        with subtests.test(key=key), refused:
            key_edges([press(0.0, key, 1.0)])


def test_held_cannons_get_a_key_of_their_own() -> None:
    machine = vehicle(cannon=True)
    later = TASKS["lift-2"].scenario
    game = played(machine, later.model_copy(update={"duration_s": 4.0}))
    assert {key: game.held(key) for key in game.calls} == {"Alpha1": [[200, None]]}
    run = prepare_run(machine, later, name="x", run_id="r")
    assert b"<String>Alpha5</String><String>Alpha1</String>" in run.machine_file
    at_once = TASKS["lift-1"].scenario
    assert played(machine, at_once.model_copy(update={"duration_s": 4.0})).calls == {}
    assert b"Alpha1" not in prepare_run(machine, at_once, name="x", run_id="r").machine_file
    assert played(vehicle(), later.model_copy(update={"duration_s": 4.0})).calls == {}


def test_the_scenario_says_which_blocks_are_reported() -> None:
    machine = vehicle(cannon=True)
    everything = ("1", "2", "3", "4", "5")
    assert tracked_blocks(machine, TASKS["transport-1"].scenario) == ("1", "2", "3")
    assert tracked_blocks(machine, TASKS["support-2"].scenario) == ()
    assert tracked_blocks(machine, TASKS["lift-1"].scenario) == everything
    assert tracked_blocks(machine, TASKS["lift-3"].scenario) == everything
    assert tracked_blocks(machine, Scenario(duration_s=1.0, tracked_blocks=("4",))) == ("4",)
    with pytest.raises(MachineNotPlayableError, match="no block 9"):
        tracked_blocks(machine, Scenario(duration_s=1.0, tracked_blocks=("9",)))


def test_a_run_knows_ground_level_and_duration() -> None:
    machine = vehicle()
    run = prepare_run(machine, TASKS["support-1"].scenario, name="a-1_b", run_id="r")
    assert (run.set_ground, run.duration_s, run.tracked) == (False, 17.0, ())
    assert run.level is not None
    run = prepare_run(machine, TASKS["transport-1"].scenario, name="a", run_id="r")
    assert (run.set_ground, run.duration_s, run.level) == (True, 30.0, None)
    assert run.script.encode()[:40] in run.machine_file


def test_names_that_cannot_be_typed_are_refused(subtests) -> None:
    for name in ["", "A", "a b", "a.bsg", "ä", "a" * 101, 'a"']:
        with subtests.test(name=name), pytest.raises(ValueError, match="lower case letters"):
            prepare_run(vehicle(), SHORT, name=name, run_id="r")


EVIL = ['"]]os.exit()--', "a\nb", "\\", "ü,1", "'); error('", "]]", "\x00", "ba,run-1,e,1", "%d %s"]


def test_texts_of_users_stay_texts(subtests) -> None:
    for evil in EVIL:
        for version in ["lua51", "lua54"]:
            with subtests.test(evil=evil, version=version):
                machine = vehicle()
                document = machine.to_document()
                for block in document["blocks"]:
                    block["id"] += evil
                    block["note"] = evil
                    if block["mount"]:
                        block["mount"][0] += evil
                machine = type(machine).from_document({**document, "next_id": 90})
                game = played(machine, SHORT, run_id=evil, version=version)
                trajectory = trajectory_of(log_of(game, evil), machine, SHORT, game="1", mod="2")
                assert trajectory.block_ids == tuple(machine.blocks)[:3]


@given(st.text(max_size=30))
@settings(max_examples=100, deadline=None)
def test_any_text_is_a_lua_text(text) -> None:
    import lupa.lua54

    runtime = lupa.lua54.LuaRuntime(encoding=None)
    assert runtime.execute(f"return {lua_text(text)}".encode()) == text.encode("utf-8", "replace")


def test_the_first_lines_are_printed_again_at_one_and_at_two_seconds(subtests) -> None:
    for version in VERSIONS:
        with subtests.test(version=version):
            lines = played(vehicle(), SHORT, version=version, updates=230).lines
            parts = [line.split(",") for line in lines]
            early = [",".join(part) for part in parts if part[2] == "s" and int(part[3]) <= 60]
            assert {line: early.count(line) for line in early} == dict.fromkeys(early, 3)
            assert len(set(early)) == 15
            begins = (f",s,{update}," for update in (100, 200))
            one, two = (
                next(i for i, line in enumerate(lines) if begin in line) for begin in begins
            )
            for at in (one, two):
                assert set(early) <= set(lines[at : at + 30])


def test_a_large_machine_does_not_push_its_own_lines_out_of_the_window() -> None:
    machine = vehicle()
    for _ in range(92):
        assert attach(machine, str(machine.state.next_id - 1), "E").ok
    lines = played(machine, Scenario(duration_s=2.0), updates=130).lines
    at = next(i for i, line in enumerate(lines) if ",s,100,12," in line)
    again = lines[at + 1 : next(i for i, line in enumerate(lines) if ",s,104,1," in line)]
    assert len(again) == 150
    assert set(again) <= set(lines[:at])


def test_a_block_that_the_game_destroyed_is_not_asked_where_it_is() -> None:
    game = played(vehicle(), Scenario(duration_s=2.0), destroyed=lambda i, n: i == 2 and n > 100)
    entries = [line.split(",") for line in game.lines if ",s," in line]
    states = {int(one[3]): one[17] for one in entries}
    assert (states[100], states[104], states[200]) == ("-", "x", "x")
    places = {int(one[3]): one[18:21] for one in entries}
    assert places[200] == places[100], "where it was last"
    trajectory = trajectory_of(log_of(game), vehicle(), Scenario(duration_s=2.0), game="1", mod="2")
    assert trajectory.pieces[-1].tolist() == [0, 0, 2, 0], "it is joined to nothing any more"


def test_a_script_formats_no_number_as_the_computers_language_has_it() -> None:
    """The mod's %f ignores its precision, and writes a comma where people write one."""
    for task in TASKS.values():
        try:
            script = prepare_run(vehicle(cannon=True), task.scenario, name="a", run_id="r").script
        except MachineNotPlayableError:
            continue
        code = [line for line in script.splitlines() if not line.startswith("--")]
        assert not [line for line in code if "%f" in line or "%g" in line or "tostring" in line]


PLAYABLE = [
    name
    for name, task in TASKS.items()
    if task.scenario.placement.kind != "released"
    and (task.scenario.cargo is None or task.scenario.cargo.at is None)
    and task.scenario.gravity == Scenario(duration_s=1.0).gravity
    and task.scenario.drive_strength == 1
]
TERRAINS = {TASKS[name].scenario.terrain: name for name in PLAYABLE}
"""A task of each level there is."""


def short(name: str) -> Scenario:
    return TASKS[name].scenario.model_copy(update={"duration_s": 1.0})


def judged(scenario: Scenario, **game: object):
    machine = vehicle()
    log = log_of(played(machine, scenario, **game))
    return trajectory_of(log, machine, scenario, game="1", mod="2")


def test_every_level_but_the_tasks_own_is_found_out(subtests) -> None:
    names = list(TERRAINS.values())
    for wanted, other in zip(names, [*names[1:], names[0]], strict=True):
        for opened in (wanted, other):
            terrain = TASKS[opened].scenario.terrain
            game = {"ground": lambda east, north, terrain=terrain: height_at(terrain, east, north)}
            with subtests.test(wanted=wanted, opened=opened):
                if wanted == opened:
                    measured = judged(short(wanted), **game).settings["measured_gravity"]
                    assert measured == -32.81
                else:
                    with pytest.raises(LogIncompleteError, match=r"Another level was open .*: at "):
                        judged(short(wanted), **game)


def test_boxes_a_little_higher_or_lower_than_written_are_the_level(subtests) -> None:
    for top in [4.2, 4.5, 5.0, 5.5]:
        with subtests.test(top=top):
            scenario = short("support-2")
            at = scenario.terrain
            found = judged(scenario, ground=lambda e, n: top if height_at(at, e, n) > 0.0 else 0.05)
            assert found.settings["measured_ground"] == top


def test_another_gravity_is_another_level(subtests) -> None:
    for gravity in [0.0, -9.81, -32.0, 32.81, float("nan")]:
        with subtests.test(gravity=gravity), pytest.raises(LogIncompleteError, match="gravity is"):
            judged(short("transport-1"), gravity=gravity)


def test_a_place_below_the_machine_is_not_judged() -> None:
    scenario = short("support-1")
    at = scenario.terrain
    found = judged(scenario, ground=lambda e, n: "b" if e < 5 else height_at(at, e, n))
    assert found.settings["measured_ground"] == 5.0


def test_a_level_that_was_not_seen_is_not_believed(subtests) -> None:
    for ground in ["b", None, float("nan")]:
        refused = pytest.raises(LogIncompleteError, match="Another level was open")
        with subtests.test(ground=ground), refused:
            judged(short("support-1"), ground=lambda _e, _n: ground)


def test_a_log_without_the_line_about_the_level_is_refused() -> None:
    scenario = short("transport-1")
    machine = vehicle()
    game = played(machine, scenario)
    game.lines = [line for line in game.lines if ",w," not in line]
    with pytest.raises(LogIncompleteError, match="line about the level is missing"):
        trajectory_of(log_of(game), machine, scenario, game="1", mod="2")


def test_a_tilted_boxs_height_is_that_of_its_upper_side() -> None:
    box = TerrainBox(center=(0.0, 0.0, 1.0), size=(4.0, 10.0, 2.0), slope_deg=30.0)
    # The middle of the upper side is 1 along the box's own vertical: half a unit south, 0.87 up.
    assert height_at((box,), 0.0, -0.5) == pytest.approx(1.0 + 0.75**0.5)
    rise = height_at((box,), 1.0, 2.0) - height_at((box,), 1.0, 1.0)
    assert rise == pytest.approx(3**-0.5)
    assert height_at((box,), 2.1, 0.0) == 0.0


def test_many_boxes_have_few_probes() -> None:
    box = TerrainBox(center=(0.0, 0.0, 0.25), size=(1.0, 1.0, 0.5))
    terrain = tuple(box.model_copy(update={"center": (3.0 * i, 30.0, 0.25)}) for i in range(64))
    assert len(level_probes(Scenario(duration_s=1.0, terrain=terrain))) == MAX_PROBES
