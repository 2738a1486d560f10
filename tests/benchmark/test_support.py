"""Support and lift: where the load goes, and what thrust counts. Trajectories made by hand."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
import pytest
from support.machines.building import attach, built, connect
from support.machines.families import beam
from tests.benchmark.conftest import Path, make_trajectory, shifted, with_bearing, with_pieces

from buildarena_benchmark import score
from buildarena_benchmark.scores import decided_length
from buildarena_benchmark.scoring.measures.components import joined_to_start
from buildarena_benchmark.scoring.measures.outline import extents
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.spanning import terrain_sides
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.trajectory import Break

Series = np.ndarray


def _mass(t: Series) -> Series:
    return 5 + 1495 * np.clip((t - 0.5) / 15, 0.005, 1)


def _at(time_s: float) -> object:
    """The cargo's mass at a time."""
    return pytest.approx(float(_mass(np.array([time_s]))[0]), abs=4.1)


def _carried(
    machine: Machine,
    *,
    fall_at: float | None = None,
    start: float = 9.0,
    north: Callable[[Series], Series] = np.zeros_like,
) -> Trajectory:
    """A cargo that is released at a height, lands at 6.75, and falls freely from a time on."""

    def path(t: Series) -> Series:
        height = np.maximum(start - GRAVITY / 2 * t**2, 6.75)
        if fall_at is not None:
            height -= GRAVITY / 2 * np.maximum(t - fall_at, 0.0) ** 2
        return np.column_stack([np.zeros_like(t), north(t), np.maximum(height, 0.75)])

    return make_trajectory(machine, 17.0, cargo=path, cargo_mass=_mass)


def _shared(
    trajectory: Trajectory,
    *,
    floor: float | Series = 0.0,
    south: float | Series = 0.5,
    dead: tuple[float, float, float] = (0.0, 0.0, 0.0),
    held: float = 1.0,
    until: float = np.inf,
) -> Trajectory:
    """The load goes to floor and terrains by shares, in addition to dead weights on each."""
    t, mass = trajectory.time_s, trajectory.cargo_mass
    assert mass is not None
    load = np.where((t > 0.4) & (t <= until), held * mass, 0.0)
    return with_bearing(
        trajectory,
        ground=floor * load + dead[0],
        south=south * load + dead[1],
        north=(1.0 - floor - south) * load + dead[2],
        cargo=load,
    )


def test_a_bridge_spans_until_its_cargo_sinks(tasks, car) -> None:
    task = tasks["support-1"]
    result = score(task, car, _shared(_carried(car)))
    assert (result.success, result.indicator, result.flags) == (True, 1500.0, ("never_fell",))
    assert result.metrics["floor_share"] == pytest.approx(0.0, abs=1e-6)
    assert result.metrics["carried_share"] == pytest.approx(1.0, abs=0.02)
    fell_s = 6.0 + np.sqrt(2 * 2.75 / GRAVITY)  # from 6.75 to 4
    result = score(task, car, _shared(_carried(car, fall_at=6.0), until=6.0))
    assert (result.success, result.flags, result.indicator) == (True, (), _at(fell_s))
    assert result.metrics["fall_time_s"] == pytest.approx(fell_s, abs=0.05)
    for fall_at, success in ((1.5, False), (2.1, True)):  # it is up for two seconds
        result = score(task, car, _carried(car, fall_at=fall_at))
        assert (result.success, result.indicator > 0) == (success, success)
    # Without contact forces that rule is not measured.
    result = score(task, car, _carried(car))
    assert (result.success, result.flags) == (True, ("never_fell", "span_not_measured"))
    assert result.metrics["floor_share"] is None
    high = score(task, car, _carried(car, start=20.5))
    assert (high.success, high.indicator, high.flags[0]) == (False, 0.0, "start_too_high")


def test_whether_the_load_goes_to_both_terrains(tasks, car, subtests) -> None:
    for name, shares, spans in (
        ("scrapes the floor", {"floor": 0.09, "south": 0.45}, True),
        ("rests unevenly", {"south": 0.2}, True),
        ("a heavy end", {"dead": (0.0, 30.0, 300.0)}, True),
        ("a tower", {"floor": 1.0, "south": 0.0}, False),
        ("pillars", {"floor": 0.5, "south": 0.25}, False),
        ("hardly a pillar", {"floor": 0.12, "south": 0.44}, False),
        ("south only", {"south": 1.0}, False),
        ("north only", {"south": 0.0}, False),
        ("the north carries hardly anything", {"floor": 0.09, "south": 0.90}, False),
        # Dead weight besides: of a tower's companion that lies on the terrains, or of one side's.
        ("tower and weights", {"floor": 1.0, "south": 0.0, "dead": (0.0, 4000, 4000)}, False),
        ("south and a weight", {"south": 1.0, "dead": (0.0, 0.0, 100.0)}, False),
        ("pillars and weights", {"floor": 0.5, "south": 0.25, "dead": (0, 4000, 4000)}, False),
        ("north and a weight", {"south": 0.06, "dead": (0.0, 0.0, 9000.0)}, False),
        ("a wall holds half of it", {"held": 0.5}, False),
        ("a terrain's edge holds it", {"held": 0.0}, False),
    ):
        with subtests.test(name=name):
            result = score(tasks["support-1"], car, _shared(_carried(car), **shares))
            assert (result.success, result.indicator) == (spans, 1500.0 * spans)
            assert result.flags == (("never_fell",) if spans else ("does_not_span",))


def test_a_bridge_that_sinks_onto_a_tower(tasks, car) -> None:
    for sinks_at, spans in ((8.0, False), (12.0, False), (15.3, True)):
        trial = _carried(car, fall_at=15.6 if spans else None)
        floor = np.where(trial.time_s > sinks_at, 1.0, 0.0)
        until = 15.6 if spans else np.inf
        sunk = _shared(trial, floor=floor, south=(1 - floor) / 2, until=until)
        assert score(tasks["support-1"], car, sunk).success == spans


def test_a_trial_goes_on_for_a_second_after_its_cargo_is_lost(tasks, car) -> None:
    task = tasks["support-1"]
    fallen, kept = _carried(car, fall_at=6.0), _carried(car)
    lost = int(np.argmax(fallen.cargo_position[:, 2] < 4.0))
    assert decided_length(task, fallen) == lost + 26
    assert decided_length(task, kept) == task.scenario.sample_count


def test_a_crash_onto_the_floor_after_the_break_that_starts_it_does_not_count(tasks, car) -> None:
    fallen = _carried(car, fall_at=15.6)
    for breaks_at, crashes_at, spans in (
        (15.2, 15.3, True),
        (None, 15.3, False),
        (8.0, 8.1, False),
    ):
        floor = np.where(fallen.time_s > crashes_at, 20.0, 0.0)
        crashed = _shared(fallen, floor=floor, south=0.5 - floor / 2, until=15.6)
        if breaks_at is not None:
            broken = Break(
                time_s=breaks_at, joint="1-2", kind="attachment", ratio=1.1, cargo_mass=None
            )
            crashed = replace(crashed, breaks=(broken,))
        assert score(tasks["support-1"], car, crashed).success == spans, breaks_at


def test_a_cargo_stays_near_the_middle(tasks, car, subtests) -> None:
    for name, most in (("support-1", 1.0), ("support-2", 1.25), ("support-3", 2.5)):
        for share, way in product((0.95, 1.05), (1, -1)):
            with subtests.test(name=name, share=share, way=way):
                far = share * most
                aside = partial(lambda t, way, far: way * np.clip(t - 1, 0, far), way=way, far=far)
                result = score(tasks[name], car, _shared(_carried(car, north=aside)))
                assert ("never_fell" in result.flags) == (share < 1)
                assert (result.indicator == 1500.0) == (share < 1)
    slow = _shared(_carried(car, north=lambda t: np.maximum(t - 4.0, 0.0)))
    for name, time_s in (("support-1", 5.04), ("support-2", 5.28)):
        result = score(tasks[name], car, slow)
        assert (result.success, result.indicator) == (True, _at(time_s))
    for north in (lambda t: -np.maximum(t - 0.5, 0.0) * 3.0, lambda t: np.full_like(t, 9.0)):
        for trial in (slid := _carried(car, north=north), _shared(slid)):
            result = score(tasks["support-1"], car, trial)
            assert (result.success, result.indicator) == (False, 0.0), "it slid off at once"


def test_islands_in_the_gap_and_boxes_behind_belong_to_the_scenario(tasks) -> None:
    content = tasks["support-2"].scenario.model_dump()
    south, north = content["terrain"]
    island = {"center": (0.0, 0.0, 2.0), "size": (4.0, 4.0, 4.0)}
    scenario = Scenario.model_validate(content | {"terrain": [island, north, south]})
    assert terrain_sides(scenario) == ([2], [1])
    one = Scenario.model_validate(content | {"terrain": [south]})
    assert terrain_sides(one) is terrain_sides(tasks["transport-1"].scenario) is None


def test_bridges_that_collapse(tasks, subtests) -> None:
    def north_of_the_middle(machine: Machine) -> list[str]:
        return [block.id for block in machine.blocks.values() if block.center_xyz[1] > 0.1]

    bar, task = beam(7), tasks["support-1"]
    north = north_of_the_middle(bar)
    south = [block for block in bar.blocks if block not in {"1", *north}]
    for name, groups in {
        "halves": [north],
        "an end": [north[-2:]],
        "thirds": [north, south],
        "bits": [[block] for block in bar.blocks],
    }.items():
        with subtests.test(name=name):
            result = score(task, bar, with_pieces(_shared(_carried(bar)), *groups, since_s=6.0))
            assert (result.success, result.indicator, result.flags) == (True, _at(6.0), ())
            assert result.metrics["load_on_debris"] == 1500.0
            assert result.metrics["collapse_time_s"] == pytest.approx(6.0)
    early = score(task, bar, with_pieces(_shared(_carried(bar)), north, since_s=1.0))
    assert (early.success, early.indicator) == (False, 0.0), "debris from the start is not a bridge"
    long = beam(9)
    tip = max(long.blocks.values(), key=lambda block: block.center_xyz[1]).id
    assert connect(bar, "1", "E", north[-1], "D", connector="Winch").ok
    for name, machine, piece in (("a part broke off", long, [tip]), ("ropes hold", bar, north)):
        with subtests.test(name=name):
            trial = with_pieces(_shared(_carried(machine)), piece, since_s=6.0)
            result = score(task, machine, trial)
            assert (result.success, result.indicator) == (True, 1500.0)
            assert result.metrics["load_on_debris"] is None


# Lift


def _climb(machine: Machine, height: Path, *heated: bool) -> Trajectory:
    def up(t: Series) -> Series:
        return np.column_stack([np.zeros((len(t), 2)), height(t)])

    return make_trajectory(machine, 30.0, moved=up, heated=heated)


def test_thrust_over_weight_counts_heated_and_cold_cannons(tasks, engine_machine) -> None:
    for heated, thrust in (((True, True), 27.52), ((True, False), 15.36), ((False, False), 3.2)):
        trial = make_trajectory(engine_machine, 10.0, heated=heated)
        result = score(tasks["lift-1"], engine_machine, trial)
        assert result.indicator == pytest.approx(thrust / 3.25, rel=1e-6)
        assert result.success == (thrust > 3.25)
        assert result.metrics["heated_cannons"] == sum(heated)


def test_a_rocket_keeps_rising_by_its_thrust(tasks, engine_machine) -> None:
    def rises(t: Series) -> Series:
        return np.maximum(t - 2, 0) * 4

    rising = score(tasks["lift-2"], engine_machine, _climb(engine_machine, rises, True, True))
    assert (rising.success, rising.flags) == (True, ())
    assert rising.indicator == pytest.approx(28 * 4, abs=0.01)
    assert rising.metrics["rise"] == pytest.approx(20.0, abs=0.1)
    hop = _climb(engine_machine, lambda t: np.maximum(40 - 16 * np.abs(t - 5), 0.0), True, True)
    result = score(tasks["lift-2"], engine_machine, hop)
    assert (result.success, result.indicator > 30) == (False, True)
    miracle = score(tasks["lift-2"], engine_machine, _climb(engine_machine, rises, False, False))
    assert (miracle.success, miracle.flags) == (True, ("twr_below_one",))


def test_a_flight_ends_when_a_rocket_touches_the_ground(tasks, engine_machine, subtests) -> None:
    """Up to a height and down to another by 10 units/s, then up for good."""
    for height, low, turn_s in (
        (20.0, 0.0, 6.0),  # it lands and takes off again
        (20.0, 0.0, 6.011),  # between two samples
        (20.0, 0.0, 6.027),
        (3.0, 0.0, 2.6),
        (1.6, 0.0, 2.32),
        (0.8, 0.0, None),  # it hops on its pad before it takes off
        (20.0, 1.0, None),  # it passes over the ground
    ):
        with subtests.test(height=height, low=low, turn_s=turn_s):
            down_s = turn_s or 2.0 + (2 * height - low) / 10
            times = [0, down_s - (2 * height - low) / 10, down_s - (height - low) / 10, down_s, 40]
            heights = [0, 0, height, low, low + 10 * (40 - down_s)]
            flight = _climb(
                engine_machine, lambda t, x=times, y=heights: np.interp(t, x, y), True, True
            )
            world = tasks["lift-2"].scenario
            run = Run(scenario=world, machine=engine_machine, trajectory=flight)
            ground = extents(run, axis=2)[0][0].min()
            flight = shifted(flight, [0, 0, -ground])
            result = score(tasks["lift-2"], engine_machine, flight)
            assert result.success == (turn_s is None)
            if turn_s is not None:
                top = float(flight.positions[0, :, 2].max())
                assert result.indicator == pytest.approx(height + top, abs=0.4)
                assert result.metrics["landed_s"] == pytest.approx(turn_s, abs=0.09)


# Pieces: what is not joined to the starting block counts for nothing


def _engine(*sprays: int) -> Machine:
    """A starting block with a cannon on each of its faces A, B, E, F, turned by quarter turns."""
    machine = built(*(("1", face, "Water Cannon") for face, _ in zip("ABEF", sprays, strict=False)))
    for block, turns in zip([*machine.blocks][1:], sprays, strict=True):
        if turns:
            assert machine.act("twist_block", {"block_id": block, "angle": 90.0 * turns}).ok
    return machine


DOWN = [
    next(
        turn
        for turn in range(4)
        if _engine(*[0] * place, turn).blocks[str(place + 2)].pointing_xyz[2] < -0.99
    )
    for place in range(4)
]
"""How many quarter turns make each of four cannons spray down."""


def test_cannons_add_as_arrows(tasks) -> None:
    for turned, net in (((0, 0, 0, 0), 4.0), ((2, 0, 2, 0), 0.0), ((2, 0, 0, 0), 2.0)):
        machine = _engine(*np.add(DOWN, turned).tolist())
        result = score(tasks["lift-1"], machine, make_trajectory(machine, 10.0, heated=[True] * 4))
        assert result.indicator == pytest.approx(net * 13.76 / 6.25, abs=1e-5)
        assert result.success == (net > 0)
    machine = _engine(DOWN[0], DOWN[1] + 1)
    result = score(tasks["lift-1"], machine, make_trajectory(machine, 10.0, heated=[True, False]))
    assert result.indicator == pytest.approx(np.hypot(13.76, 1.6) / 3.25, abs=1e-5)


def test_a_cannon_that_breaks_off_no_longer_counts(tasks) -> None:
    machine = _engine(*DOWN)
    whole = make_trajectory(machine, 10.0, heated=[True] * 4)
    for trial, share in (
        (with_pieces(whole, ["2"], since_s=5.0), 3 / 6.25),  # its weight still counts
        (with_pieces(whole, ["2"]), 3 / 4.75),
        (with_pieces(whole, ["2"], ["3"], ["4"], ["5"]), 0.0),
    ):
        indicator = score(tasks["lift-1"], machine, trial).indicator
        assert indicator == pytest.approx(share * 13.76, abs=1e-5)


def test_a_cannon_that_flies_alone_lifts_nothing(tasks) -> None:
    machine = _engine(*DOWN)

    def flight(*flying: str) -> Trajectory:
        trial = make_trajectory(machine, 30.0, heated=[True] * 4)
        up = 8.0 * np.maximum(trial.time_s - 2.0, 0.0)
        return shifted(trial, np.outer(up, [0, 0, 1]), *flying)

    torn = with_pieces(flight("2"), ["2"], since_s=2.0)
    result = score(tasks["lift-2"], machine, torn)
    assert not result.success
    assert result.indicator < 3.0
    assert score(tasks["lift-2"], machine, replace(torn, pieces=None)).indicator > 200.0
    lost = with_pieces(flight(*"1234"), ["5"], since_s=2.0)
    result = score(tasks["lift-2"], machine, lost)
    assert (result.success, result.flags) == (True, ()), "a rocket that loses a part continues"


def test_parts_on_a_rope_belong_to_the_piece_until_it_gives_way() -> None:
    machine = _engine(*DOWN)
    assert attach(machine, "1", "C").ok
    assert attach(machine, "6", "E").ok
    assert connect(machine, "7", "A", "1", "D", connector="Winch").ok
    trial = with_pieces(make_trajectory(machine, 4.0, heated=[True] * 4), ["7"])
    column = trial.block_ids.index("7")
    assert joined_to_start(machine, trial).all()
    event = Break(time_s=2.0, joint="Winch 8", kind="rope", ratio=1.1, cargo_mass=None)
    joined = joined_to_start(machine, replace(trial, breaks=(event,)))
    assert joined[trial.time_s < 2.0, column].all()
    assert not joined[trial.time_s >= 2.0, column].any()
