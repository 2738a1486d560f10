"""Worlds: what a seed draws, wind, pushes, gravity, and drives that are stronger or weaker."""

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from support.machines.building import KeyedDraft
from support.machines.families import beam as beam_of

from buildarena_benchmark.experts.drafting import EAST, NORTH, SOUTH, UP, WEST
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, simulate, write_trajectory
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.gusts import Wind
from buildarena_simulation.scenario import Control, Gusts

FALL = {"kind": "released", "height": 50}


DRAWN: dict[str, Any] = {
    "duration_s": 2,
    "placement": FALL,
    "terrain": [{"center": [0, 40, 1], "size": [4, 4, 2]}],
    "marks": [{"name": "the goal", "center": [1, 2, 0], "radius": 1}],
    "randomization": {
        "placement.height": [40, 70],
        "placement.velocity": [[-8, 0, -4], [8, 8, 0]],
        "marks.the goal.center": [[-6, -6, 0], [6, 6, 0]],
        "terrain.1.slope_deg": [-4, 4],
        "gravity": [30, 36],
    },
}


def drawn(**changes: Any) -> Scenario:
    return Scenario.model_validate(DRAWN | changes)


def test_each_seed_has_its_world_within_the_ranges_and_none_has_what_is_written() -> None:
    worlds = [drawn().world(seed) for seed in range(50)]
    assert worlds == [drawn().world(seed) for seed in range(50)]
    assert len({world.model_dump_json() for world in worlds}) == 50
    for figure, (low, high) in {
        lambda w: w.placement.height: (40, 70),
        lambda w: w.placement.velocity[2]: (-4, 0),
        lambda w: w.marks[0].center[1]: (-6, 6),
        lambda w: w.terrain[0].slope_deg: (-4, 4),
        lambda w: w.gravity: (30, 36),
    }.items():
        values = [figure(world) for world in worlds]
        assert low <= min(values) < low + 0.15 * (high - low)
        assert high >= max(values) > high - 0.15 * (high - low)
    drawn_alike = np.corrcoef(
        [(world.placement.height, world.gravity) for world in worlds], rowvar=False
    )
    assert abs(drawn_alike[0, 1]) < 0.5, "each range has draws of its own"
    assert all(not world.randomization and world.duration_s == 2 for world in worlds)
    exact = drawn().world(None)
    assert (exact.placement.height, exact.gravity, exact.randomization) == (50, GRAVITY, {})
    plain = drawn(randomization={})
    assert plain.world(7) is plain


def test_a_range_more_leaves_what_others_draw() -> None:
    """So that a task's next version, with one thing more that differs, keeps its worlds."""
    more = drawn().world(4)
    for path in DRAWN["randomization"]:
        ranges = {name: ends for name, ends in DRAWN["randomization"].items() if name != path}
        less, names = drawn(randomization=ranges).world(4), Scenario.model_fields
        differ = {name for name in names if getattr(more, name) != getattr(less, name)}
        assert differ == {path.partition(".")[0]}


UNDRAWN = [
    ({"marks.gool.center": [[0, 0, 0], [1, 1, 1]]}, "there is no 'gool', but the goal"),
    ({"placement.depth": [0, 1]}, "there is no 'depth', but kind, height, velocity"),
    ({"placement.height.x": [0, 1]}, "there is no 'x', but nothing"),
    ({"placement.velocity": [0, 1]}, "not a figure"),
    ({"placement.velocity": [[0, 0], [1, 1]]}, "not 2 figures"),
    ({"duration_s": [1, 600]}, "what can be drawn is in terrain, cargo"),
    ({"senses.delay_ticks": [0, 1]}, "what can be drawn is in terrain, cargo"),
    ({"placement.height": [60, 50]}, "60.0 to 50.0 is not a range"),
    ({"placement.velocity": [[0, 0, 0], [1, -1, 1]]}, "is not a range"),
    ({"placement.height": [50, 2000]}, "at the end of a range, placement.released.height"),
    ({"gravity": [0, 36]}, "at the end of a range, gravity"),
    ({"gusts.strength": [1, 2]}, "there is no 'gusts'"),
    ({"placement.height": [float("nan"), 60]}, "finite"),
    ({f"x{k}": [0, 1] for k in range(65)}, "at most 64"),
]


def test_what_cannot_be_drawn_is_refused_with_its_place() -> None:
    for randomization, told in UNDRAWN:
        with pytest.raises(ValidationError, match="randomization") as caught:
            drawn(randomization=randomization)
        assert told in str(caught.value)


def test_a_trial_is_put_through_the_world_of_its_seed(engine) -> None:
    machine = beam_of(3)
    for seed in (None, 4):
        world = drawn().world(seed)
        trial = simulate(machine, drawn(), engine, seed=seed)
        assert trial.settings["gravity"] == world.gravity
        first, second = trial.positions[0], trial.positions[1]
        assert float(first[:, 2].min()) == pytest.approx(world.placement.height + 0.5, abs=0.3)
        speed = (second - first)[0] * 25
        assert speed[:2] == pytest.approx(world.placement.velocity[:2], abs=0.3)
        # The same as a trial of that world itself, but for the scenario's name.
        alone = simulate(machine, world, engine, seed=seed)
        assert np.array_equal(trial.positions, alone.positions)
        assert trial.settings["scenario"] != alone.settings["scenario"]
    assert write_trajectory(trial) == write_trajectory(simulate(machine, drawn(), engine, seed=4))


def test_wind_keeps_to_its_strength_and_is_another_with_each_seed() -> None:
    times = np.arange(0, 60, 0.04)
    blown = [np.array([Wind(Gusts(strength=6), seed).at(t) for t in times]) for seed in range(8)]
    sizes = [np.linalg.norm(one, axis=1) for one in blown]
    assert all(size.max() <= 6 for size in sizes)
    assert max(size.max() for size in sizes) > 4
    assert all(not one[:, 2].any() for one in blown)
    assert len({one.tobytes() for one in blown}) == 8
    # Band-limited: the quickest wave has two seconds, so nothing jumps.
    assert max(np.abs(np.diff(one, axis=0)).max() for one in blown) < 6 * 2 * np.pi / 2 * 0.04


def test_wind_moves_what_falls_as_its_integral_says(engine) -> None:
    seed = 5
    scenario = Scenario.model_validate(
        {"duration_s": 2, "placement": FALL | {"height": 500}, "gusts": {"strength": 6}}
    )
    trial = simulate(beam_of(3), scenario, engine, seed=seed)
    calm = simulate(beam_of(3), scenario.model_copy(update={"gusts": None}), engine, seed=seed)
    wind, drag, step = Wind(Gusts(strength=6), seed), 0.2, 0.001
    speed, place = np.zeros(3), np.zeros(3)
    for k in range(2000):
        speed += step * (wind.at(k * step) - drag * speed)
        place += step * speed
    moved = (trial.positions[-1] - calm.positions[-1]).astype(float).mean(axis=0)
    assert np.linalg.norm(place) > 1
    assert moved == pytest.approx(place, abs=0.05 * np.linalg.norm(place))
    # What everything is accelerated by alike strains nothing.
    most = max(peak.ratio for peak in trial.joint_peaks)
    assert most < 0.05 + max(peak.ratio for peak in calm.joint_peaks)


PUSHES = [{"at_s": 0.4, "velocity": [1.2, 0]}, {"at_s": 1.013, "velocity": [-0.5, 2]}]


def falling(**fields: Any) -> Scenario:
    return Scenario.model_validate({"duration_s": 2, "placement": FALL | {"height": 500}, **fields})


def test_a_push_changes_the_velocity_of_what_falls_and_strains_nothing(engine) -> None:
    calm = simulate(beam_of(3), falling(), engine)
    pushed = simulate(beam_of(3), falling(pushes=PUSHES), engine)
    apart = (pushed.positions - calm.positions).astype(float)
    speed = np.diff(apart, axis=0).mean(axis=1) * 25
    drag = 0.2
    # Between the pushes, and after both: the air takes a little.
    first = np.array([1.2, 0, 0])
    assert speed[16] == pytest.approx(first * np.exp(-drag * 0.15), rel=0.05, abs=0.02)
    both = first * np.exp(-drag * 0.8) + np.array([-0.5, 2, 0]) * np.exp(-drag * 0.2)
    assert speed[32] == pytest.approx(both, rel=0.05, abs=0.02)
    assert not apart[:10].any()
    most = max(peak.ratio for peak in pushed.joint_peaks)
    assert most < 0.01 + max(peak.ratio for peak in calm.joint_peaks)


def heavy_car() -> Machine:
    """A car whose wheels' torque decides how fast it gets going, not their grip."""
    draft = KeyedDraft(modules="workshop")
    middle = draft.start()
    for way in (NORTH, SOUTH):
        row = draft.row(middle, way, 7)
        for block in row[:5]:
            for side in (EAST, WEST):
                draft.row(block, side, 4)
        for side in (EAST, WEST):
            draft.bind(draft.wheel(row[-1], side), "spinning_forward", "Alpha1")
    draft.press("Alpha1", 1.0, 3.0)
    return draft.machine


def test_bearing_is_in_weights_and_joints_bear_the_true_weight(engine) -> None:
    draft = KeyedDraft()
    middle = draft.start()
    draft.row(draft.row(middle, UP, 2)[-1], EAST, 5)
    for way, count in ((EAST, 4), (WEST, 3)):
        draft.row(middle, way, count)
    worlds = (Scenario(duration_s=4, gravity=gravity) for gravity in (GRAVITY, 60.0))
    usual, other = (simulate(draft.machine, world, engine) for world in worlds)
    for trajectory in (usual, other):
        borne = trajectory.bearing.ground[-25:].mean()
        assert borne == pytest.approx(draft.machine.mass, rel=0.02)
    share = other.joint_loads[-1].max() / usual.joint_loads[-1].max()
    assert share == pytest.approx(60.0 / GRAVITY, rel=0.1)


def test_motors_drive_by_their_strength(engine) -> None:
    """How fast a heavy car gets going, far below its motors' speed."""
    machine = heavy_car()
    for strength in (0.1, 0.15):
        scenario = Scenario(duration_s=2, control=Control(mode="agent"), drive_strength=strength)
        trajectory = simulate(machine, scenario, engine)
        path = trajectory.positions[:, 0, 1].astype(np.float64)
        going = (trajectory.time_s > 1.15) & (trajectory.time_s < 1.5)
        gains = np.polyfit(trajectory.time_s[going], path[going], 2)[0] * 2
        # Four wheels of radius 1; what turns is as slow to turn as it is to move, half of it.
        expected = 4 * 20 * strength * GRAVITY / (machine.mass + 4 * 0.5)
        assert gains == pytest.approx(expected, rel=0.15)
        assert trajectory.settings["drive_strength"] == strength


def test_worlds_are_bounded() -> None:
    for field, most in (("gravity", 100), ("drive_strength", 10)):
        for value in (0, most + 1, float("nan"), float("inf")):
            with pytest.raises(ValidationError, match=field):
                Scenario(duration_s=1, **{field: value})
