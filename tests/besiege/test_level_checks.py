"""A log says which level was open; one that is not the trial's is never scored."""

import pytest
from tests.besiege.playing import log_of, played, vehicle

from buildarena_benchmark import builtin_tasks
from buildarena_besiege import LogIncompleteError, trajectory_of
from buildarena_besiege.exporting.probes import MAX_PROBES, height_at, level_probes
from buildarena_simulation import Scenario
from buildarena_simulation.scenario import TerrainBox

TASKS = builtin_tasks()
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


@pytest.mark.parametrize("opened", TERRAINS.values())
@pytest.mark.parametrize("wanted", TERRAINS.values())
def test_every_level_but_the_tasks_own_is_found_out(wanted, opened) -> None:
    terrain = TASKS[opened].scenario.terrain
    game = {"ground": lambda east, north: height_at(terrain, east, north)}
    if wanted == opened:
        assert judged(short(wanted), **game).settings["measured_gravity"] == -32.81
        return
    with pytest.raises(LogIncompleteError, match=r"Another level was open .*: at "):
        judged(short(wanted), **game)


@pytest.mark.parametrize("top", [4.2, 4.5, 5.0, 5.5])
def test_boxes_a_little_higher_or_lower_than_written_are_the_level(top) -> None:
    scenario = short("support-2")
    found = judged(
        scenario, ground=lambda e, n: top if height_at(scenario.terrain, e, n) > 0.0 else 0.05
    )
    assert found.settings["measured_ground"] == top


@pytest.mark.parametrize("gravity", [0.0, -9.81, -32.0, 32.81, float("nan")])
def test_another_gravity_is_another_level(gravity) -> None:
    with pytest.raises(LogIncompleteError, match="gravity is"):
        judged(short("transport-1"), gravity=gravity)


def test_a_place_below_the_machine_is_not_judged() -> None:
    scenario = short("support-1")
    found = judged(
        scenario, ground=lambda e, n: "b" if e < 5 else height_at(scenario.terrain, e, n)
    )
    assert found.settings["measured_ground"] == 5.0


@pytest.mark.parametrize("ground", ["b", None, float("nan")])
def test_a_level_that_was_not_seen_is_not_believed(ground) -> None:
    with pytest.raises(LogIncompleteError, match="Another level was open"):
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
