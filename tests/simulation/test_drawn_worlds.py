"""Worlds that the seed of a trial draws, and the wind in them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from support.machines.drafts import KeyedDraft
from support.machines.families import beam

from buildarena_simulation import Scenario, simulate, write_trajectory
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.gusts import Wind
from buildarena_simulation.scenario import Gusts
from buildarena_worker.builtin.designs.drafting import EAST, NORTH, SOUTH, UP, WEST

FALL = {"kind": "released", "height": 50}
DRAWN: dict[str, Any] = {
    "duration_s": 2,
    "placement": FALL,
    "terrain": [{"center": [0, 40, 1], "size": [4, 4, 2]}],
    "marks": [{"name": "the goal", "center": [1, 2, 0], "radius": 1}],
    "draws": {
        "placement.height": [40, 70],
        "placement.velocity": [[-8, 0, -4], [8, 8, 0]],
        "marks.the goal.center": [[-6, -6, 0], [6, 6, 0]],
        "terrain.1.slope_deg": [-4, 4],
        "gravity": [30, 36],
    },
}


def drawn(**changes: Any) -> Scenario:
    return Scenario.model_validate(DRAWN | changes)


def without(path: str) -> Scenario:
    return drawn(draws={name: ends for name, ends in DRAWN["draws"].items() if name != path})


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
    assert all(not world.draws and world.duration_s == 2 for world in worlds)
    exact = drawn().world(None)
    assert (exact.placement.height, exact.gravity, exact.draws) == (50, GRAVITY, {})
    plain = drawn(draws={})
    assert plain.world(7) is plain


@pytest.mark.parametrize("path", DRAWN["draws"])
def test_a_range_more_leaves_what_others_draw(path) -> None:
    """So that a task's next version, with one thing more that differs, keeps its worlds."""
    more, less = drawn().world(4), without(path).world(4)
    root = path.partition(".")[0]
    differ = {name for name in Scenario.model_fields if getattr(more, name) != getattr(less, name)}
    assert differ == {root}


@pytest.mark.parametrize(
    ("draws", "told"),
    [
        ({"marks.gool.center": [[0, 0, 0], [1, 1, 1]]}, "there is no 'gool', but the goal"),
        ({"terrain.2.slope_deg": [0, 1]}, "there is no '2', but 1"),
        ({"placement.depth": [0, 1]}, "there is no 'depth', but kind, height, velocity"),
        ({"placement.height.x": [0, 1]}, "there is no 'x', but nothing"),
        ({"placement.velocity": [0, 1]}, "stands there, not a figure"),
        ({"placement.velocity": [[0, 0], [1, 1]]}, "stands there, not 2 figures"),
        ({"placement.kind": [0, 1]}, "stands there, not a figure"),
        ({"marks.the goal": [0, 1]}, "stands there, not a figure"),
        ({"duration_s": [1, 600]}, "what can be drawn is in terrain, cargo"),
        ({"senses.delay_ticks": [0, 1]}, "what can be drawn is in terrain, cargo"),
        ({"placement.height": [60, 50]}, "60.0 to 50.0 is no range"),
        ({"placement.velocity": [[0, 0, 0], [1, -1, 1]]}, "is no range"),
        ({"placement.velocity": [[0, 0, 0], 1]}, "is no range"),
        ({"placement.height": [50, 2000]}, "at the end of a range, placement.released.height"),
        ({"marks.the goal.radius": [0, 1]}, "at the end of a range, marks.0.radius"),
        ({"gravity": [0, 36]}, "at the end of a range, gravity"),
        ({"gusts.strength": [1, 2]}, "there is no 'gusts'"),
        ({"placement.height": [float("nan"), 60]}, "finite"),
        ({f"x{k}": [0, 1] for k in range(65)}, "at most 64"),
    ],
)
def test_what_cannot_be_drawn_is_refused_with_its_place(draws, told) -> None:
    with pytest.raises(ValidationError, match="draws") as caught:
        drawn(draws=draws)
    assert told in str(caught.value)


def test_a_trial_is_put_through_the_world_of_its_seed(engine) -> None:
    machine = beam(3)
    for seed in (None, 3, 4):
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
    blown = [np.array([Wind(Gusts(strength=6), seed).at(t) for t in times]) for seed in range(20)]
    sizes = [np.linalg.norm(one, axis=1) for one in blown]
    assert all(size.max() <= 6 for size in sizes)
    assert max(size.max() for size in sizes) > 4
    assert all(not one[:, 2].any() for one in blown)
    assert len({one.tobytes() for one in blown}) == 20
    # Band-limited: the quickest wave has two seconds, so nothing jumps.
    assert max(np.abs(np.diff(one, axis=0)).max() for one in blown) < 6 * 2 * np.pi / 2 * 0.04


@pytest.mark.parametrize("seed", [None, 5])
def test_wind_moves_what_falls_as_its_integral_says(engine, seed) -> None:
    scenario = Scenario.model_validate(
        {"duration_s": 2, "placement": FALL | {"height": 500}, "gusts": {"strength": 6}}
    )
    trial = simulate(beam(3), scenario, engine, seed=seed)
    calm = simulate(beam(3), scenario.model_copy(update={"gusts": None}), engine, seed=seed)
    wind, drag, step = Wind(Gusts(strength=6), seed or 0), 0.2, 0.001
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


def test_wind_strains_what_stands_firm(engine) -> None:
    """A mast on a broad foot: the joint at its foot bears what the wind does to all above it."""
    gusts = Gusts(strength=6)
    scenario = Scenario.model_validate({"duration_s": 6, "gusts": gusts})
    draft = KeyedDraft(modules="workshop")
    middle = draft.start()
    for way in (EAST, NORTH, SOUTH, WEST):
        draft.row(middle, way, 5)
    draft.row(middle, UP, 8)
    calm = simulate(draft.machine, scenario.model_copy(update={"gusts": None}), engine)
    blown = simulate(draft.machine, scenario, engine)
    mast = [k for k, peak in enumerate(calm.joint_peaks) if peak.joint.startswith("1-")][-1]
    lever = sum(0.3 * (k + 0.5) for k in range(8))
    most = max(np.linalg.norm(Wind(gusts, 0).at(t)) for t in np.arange(0, 6, 0.04))
    assert calm.joint_peaks[mast].moment < 0.1
    assert blown.joint_peaks[mast].moment == pytest.approx(lever * most / GRAVITY, rel=0.25)


def test_a_scenario_without_them_reads_and_hashes_as_before() -> None:
    document = Scenario(duration_s=2).model_dump(mode="json")
    assert not {"gusts", "draws"} & document.keys()
