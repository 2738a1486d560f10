"""What joints, blows and landings break, as in a log of the game, and what the record tells."""

from dataclasses import replace
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from numpy.typing import NDArray
from support.machines.families import beam, car, deck
from support.machines.rigs import Rig
from support.machines.trials import gap_terrain, press, trial
from support.marks import nightly

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.experts.drafting import DOWN, EAST, NORTH, UP
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory, breaking, rollout, simulate
from buildarena_simulation.constants import (
    BOUNCE_MASS,
    CARGO_BOUNCE,
    JOINT_STRENGTH,
    MIN_LANDING_SPEED,
    JointKind,
)
from buildarena_simulation.machine import structure_of
from buildarena_simulation.rollout import simulate_structure
from buildarena_simulation.scenario import Control, ReleasedPlacement, SpanPlacement
from buildarena_simulation.structure.contacts import ContactForces
from buildarena_simulation.structure.loads import LoadModel

KINDS = {
    "Hinge": "hinge",
    "Swivel": "hinge",
    "Slider": "slider",
    "Ball Joint": "ball",
    "Axle": "constant_velocity",
    "Steering Block": "hinge",
}


INTERVAL_S = 0.04


def _hung(joint: str, weights: int) -> tuple[Rig, str]:
    """Weights that hang from a joint under an arm, clear of the mast."""
    rig = Rig()
    seat = rig.attach(rig.row(rig.top, EAST, 4)[-1], DOWN, joint)
    end = seat
    for _ in range(weights):
        end = rig.attach(end, DOWN, "Weight")
    return rig, seat


def _rig_tried(rig: Rig, engine: str, duration_s: float = 2.0) -> Trajectory:
    scenario = Scenario(duration_s=duration_s, control=Control(mode="agent"))
    return simulate(rig.machine, scenario, engine)


def test_a_shot_loads_joints_whenever_it_is_fired() -> None:
    rig = Rig()
    cannon = rig.attach(rig.row(rig.top, EAST, 4)[-1], UP, "Water Cannon")
    rig.bind(cannon, "hold_to_fire", "Alpha1")
    standing = Scenario(duration_s=1.6, control=Control(mode="agent"))
    shots = [[press("Alpha1", 1.0 + INTERVAL_S * phase, INTERVAL_S)] for phase in range(4)]
    loads = [simulate(rig.machine, standing, controls=c).joint_loads for c in ([], *shots)]
    assert all((each != loads[0]).any() for each in loads[1:])


@pytest.mark.nightly(keep=3)
@pytest.mark.parametrize("joint", KINDS)
def test_a_joint_bears_what_hangs_on_it(engine, joint) -> None:
    rig, seat = _hung(joint, 3)
    trajectory = _rig_tried(rig, engine, 3.0)
    assert not trajectory.breaks
    peak = next(peak for peak in trajectory.joint_peaks if peak.joint == f"6-{seat}")
    assert peak.kind == KINDS[joint]
    place = [p.joint for p in trajectory.joint_peaks].index(peak.joint)
    settled = trajectory.joint_loads[-1, place] * JOINT_STRENGTH[JointKind(peak.kind)].force
    load = 30 + rig.machine.blocks[seat].module.mass
    assert settled == pytest.approx(load, rel=0.04)


@pytest.mark.nightly(keep=6)
@pytest.mark.parametrize("joint", KINDS)
@pytest.mark.parametrize(("strength", "holds"), [(1.15, True), (0.9, False)])
def test_a_joint_breaks_above_its_strength_and_lets_go(
    engine: str, joint: str, strength: float, *, holds: bool
) -> None:
    rig, seat = _hung(joint, 3)
    structure = structure_of(rig.machine)
    k = structure.members.names.index(f"6-{seat}")
    # A stop that is reached in falling bears more than the weight for a moment.
    extra = 3.0 if joint == "Slider" else 1.0
    load = (30 + rig.machine.blocks[seat].module.mass) * strength * (extra if holds else 1.0)
    structure.members.limits[k, 0] = load
    scenario = Scenario(duration_s=2.0)
    trajectory = simulate_structure(structure, scenario, engine)
    assert [(one.joint, one.kind) for one in trajectory.breaks[:1]] == (
        [] if holds else [(f"6-{seat}", KINDS[joint])]
    )
    height = trajectory.positions[:, trajectory.block_ids.index(seat), 2]
    assert (height[0] - height[-1] > 2.0) != holds


def test_what_a_motor_exerts_goes_into_its_base(engine) -> None:
    # A block that spins an arm against gravity's moment hands that moment on to its mount.
    rig = Rig()
    block = rig.attach(rig.row(rig.top, NORTH, 3)[-1], NORTH, "Steering Block")
    rig.attach(rig.attach(block, EAST), EAST, "Weight")
    trajectory = _rig_tried(rig, engine)
    moment = next(p.moment for p in trajectory.joint_peaks if p.joint == f"5-{block}")
    level = next(p.moment for p in trajectory.joint_peaks if p.joint == "4-5")
    assert moment == pytest.approx(10 * 2 + 0.3, rel=0.15)
    assert level > moment * 0.9


def test_a_load_that_grows_slowly_is_rarely_evaluated_and_breaks_when_it_should(
    engine, monkeypatch
) -> None:
    scenario = builtin_tasks()["support-1"].scenario
    ramp = scenario.cargo.model_copy(update={"ramp_s": 5.0})
    short = scenario.model_copy(update={"duration_s": 3.2, "cargo": ramp})
    evaluations, breaks = [], []
    for most in (3, 0):
        monkeypatch.setattr(breaking, "_MOST_SKIPPED", most)
        evaluate = LoadModel.evaluate
        with patch.object(LoadModel, "evaluate", autospec=True, side_effect=evaluate) as evaluated:
            breaks.append(simulate(deck(3, 9), short, engine).breaks[0])
        evaluations.append(evaluated.call_count)
    assert evaluations[0] < 0.6 * evaluations[1]
    assert abs(breaks[0].time_s - breaks[1].time_s) <= INTERVAL_S


STANDING = Scenario(duration_s=1.0, control=Control(mode="agent"))


CASES = {"beam": (beam(5), STANDING), "deck": (deck(3, 5), STANDING)}


ENOUGH = 1e6
"""A push that breaks any of them, mass·unit/s²."""


class _Liar:
    """An engine that reports blows which are not there.

    Args:
        engine: The true engine.
        pushes: By the number of an interval, from 0, what it adds upwards to a contact in it at the
            usual step and in finer ones, mass·unit/s².
    """

    def __init__(self, engine: Any, pushes: dict[int, tuple[float, float]]) -> None:
        self._engine, self._pushes = engine, pushes
        self._number, self._finer = -1, 1
        self.repeated: list[int] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._engine, name)

    @property
    def struck(self) -> bool:
        """Whether something hit the machine, or is said to have."""
        return self._push > 0.0 or bool(self._engine.struck)

    def enter(self, *arguments: Any, finer: int = 1, **places: Any) -> None:
        """See `Engine`."""
        self._finer = finer
        self._engine.enter(*arguments, finer=finer, **places)

    def advance(self, *arguments: Any, watched: bool = True) -> None:
        """See `Engine`."""
        if self._finer == 1:
            self._number += 1
        else:
            self.repeated.append(self._number)
        self._engine.advance(*arguments, watched=watched)

    def contacts(self) -> ContactForces:
        """See `Engine`."""
        true = self._engine.contacts()
        added = np.zeros_like(true.force)
        added[:1, 2] = self._push
        return replace(true, force=true.force + added)

    @property
    def _push(self) -> float:
        return self._pushes.get(self._number, (0.0, 0.0))[self._finer > 1]


@pytest.fixture
def tried(engine: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Tries a case with an engine that lies."""
    create = rollout.create_engine

    def simulated(
        name: str, pushes: dict[int, tuple[float, float]]
    ) -> tuple[Trajectory, list[int]]:
        liars: list[_Liar] = []

        def lying(*arguments: Any) -> Any:
            liars.append(_Liar(create(*arguments), pushes))
            return liars[-1]

        monkeypatch.setattr(rollout, "create_engine", lying)
        trajectory = simulate(*CASES[name], engine)
        monkeypatch.setattr(rollout, "create_engine", create)
        return trajectory, liars[0].repeated

    return simulated


@pytest.mark.nightly(keep=3)
@pytest.mark.parametrize(("name", "at"), [("beam", (12,)), ("deck", (13, 20))])
def test_a_blow_that_finer_steps_do_not_show_breaks_nothing(engine, tried, name, at) -> None:
    trajectory, repeated = tried(name, dict.fromkeys(at, (ENOUGH, 0.0)))
    assert repeated == list(at)
    assert not trajectory.breaks
    assert trajectory.joint_loads.max() < 1.0
    still = simulate(*CASES[name], engine)
    assert trajectory.positions[-1] == pytest.approx(still.positions[-1], abs=0.02)


@pytest.mark.parametrize("name", ["deck", nightly("beam")])
def test_a_blow_that_finer_steps_show_breaks(tried, name) -> None:
    trajectory, repeated = tried(name, {12: (ENOUGH, ENOUGH)})
    assert repeated[0] == 12
    assert trajectory.breaks[0].time_s == pytest.approx(13 * INTERVAL_S)


def test_a_machine_that_hits_the_ground_hard_breaks(engine) -> None:
    trajectory = _thrown(car(21, 3), 100.0, engine)
    assert trajectory.breaks[0].time_s == pytest.approx(0.12, abs=0.05)


def test_what_is_repeated_gives_the_same_bytes(engine) -> None:
    first, second = (_thrown(car(15, 3), 100.0, engine) for _ in range(2))
    assert first.positions.tobytes() == second.positions.tobytes()
    assert first.joint_loads.tobytes() == second.joint_loads.tobytes()
    assert first.breaks == second.breaks


def _thrown(machine: Machine, speed: float, engine: str) -> Trajectory:
    thrown = ReleasedPlacement(height=10.0, velocity=(0.0, 0.0, -speed))
    return simulate(machine, Scenario(duration_s=1.0, placement=thrown), engine)


GAME = {"contact_s": 0.52, "peak": 6.66, "peak_s": 0.84, "again_s": 1.08}
"""When and where the cargo on a beam of seven blocks lands in a log of the game."""
BEGINS_S = 0.065
"""When the game lets things fall, by its own clock; ours does at 0."""

TERRAIN = 4.5
CARGO = (2.28, 2.28, 1.45)
FALL_HEIGHT = 4.0
"""Below it the published evaluation calls a cargo lost, units."""
_FALLS = 0.2
"""How far something falls from one sample to the next, at least, before it lands, units."""
_RESTS = 0.15
"""Above the height at the first contact, within which the second one is, units."""
_STOPS = 4
"""Samples within which something that lands is lowest."""

Floats = NDArray[np.float64]


def in_game(scenario: Scenario) -> Scenario:
    """A bridge's scenario with the sizes that the game's logs show."""
    placement, cargo = scenario.placement, scenario.cargo
    assert isinstance(placement, SpanPlacement)
    assert cargo is not None
    return scenario.model_copy(
        update={
            "terrain": gap_terrain(placement.gap, height=TERRAIN),
            "placement": SpanPlacement(gap=placement.gap, lowest_center=TERRAIN + 1.0),
            "cargo": cargo.model_copy(update={"size": CARGO}),
        }
    )


def cargo_path(trajectory: Trajectory, scenario: Scenario) -> tuple[Floats, Floats]:
    """Times by the game's clock, s, and heights of the cargo's underside, units, (T,) each."""
    assert trajectory.cargo_position is not None
    height = trajectory.cargo_position[:, 2].astype(np.float64) - scenario.cargo.size[2] / 2
    return trajectory.time_s + BEGINS_S, height


def landing_figures(time_s: Floats, height: Floats) -> dict[str, float]:
    """When and where something lands, bounces, lands again and falls through; s and units."""
    steps = np.diff(height)
    first = np.flatnonzero((steps[:-1] < -_FALLS) & (steps[1:] > 0.5 * steps[:-1]))[0] + 1
    low = first + height[first : first + _STOPS].argmin()
    top = low + np.flatnonzero(steps[low:] < 0)[0]
    back = top + np.flatnonzero(height[top:] < height[low] + _RESTS)[0]
    lost = np.flatnonzero(height < FALL_HEIGHT)[0]
    return {
        "contact_s": time_s[first],
        "peak": height[top],
        "peak_s": time_s[top],
        "again_s": time_s[back],
        "crossing_s": time_s[lost],
    }


@pytest.mark.nightly(keep=1)
def test_the_beam_of_seven_fails_as_in_the_game(engine, tasks) -> None:
    scenario = in_game(tasks["support-1"].scenario)
    trajectory = simulate(beam(7), scenario, engine)
    figures = landing_figures(*cargo_path(trajectory, scenario))
    for name, apart in (("contact_s", 0.06), ("peak", 0.25), ("peak_s", 0.06), ("again_s", 0.08)):
        assert figures[name] == pytest.approx(GAME[name], abs=apart), name
    assert figures["crossing_s"] < 1.7
    broken = trajectory.breaks[0]
    assert abs(broken.time_s + BEGINS_S - figures["again_s"]) < 0.1, "at the second landing"
    assert broken.cargo_mass == pytest.approx(61.0, abs=15.0)
    result, _ = trial(tasks["support-1"], beam(7), engine)
    assert (result.success, result.indicator) == (False, 0.0)


def test_each_bounce_has_its_share_of_the_speed_before(engine, tasks) -> None:
    scenario = tasks["support-1"].scenario.model_copy(update={"duration_s": 3.0})
    machine = beam(7, "tb")
    _, height = cargo_path(simulate(machine, scenario, engine), scenario)
    floor = float(np.median(height[-10:]))
    inside, before, after = height[1:-1], height[:-2], height[2:]
    tops = [height[0], *inside[(inside > before + 1e-3) & (inside >= after)]]
    speeds = np.sqrt(2 * scenario.gravity * (np.array(tops[:3]) - floor))
    share = CARGO_BOUNCE / (1 + machine.mass / BOUNCE_MASS)
    assert speeds[1:] == pytest.approx(share * (speeds[:-1] - MIN_LANDING_SPEED), abs=1.3)
    assert height[-10:].std() < 0.01, "it comes to rest"


def test_a_cargo_that_lands_beside_the_machine_stays_where_it_lands(engine, tasks) -> None:
    scenario = tasks["transport-2"].scenario
    cargo = scenario.cargo.model_copy(update={"at": (9.0, 0.0, 5.0)})
    trajectory = simulate(beam(3), scenario.model_copy(update={"cargo": cargo}), engine)
    height = trajectory.cargo_position[:, 2]
    landed = int((height < scenario.cargo.size[2] / 2 + 0.1).argmax())
    assert landed > 0
    assert height[landed:].max() < scenario.cargo.size[2] / 2 + 0.1


def test_what_lies_does_not_hop(engine, tasks) -> None:
    """A cargo that grows heavier where it lies is never thrown up again."""
    _, trajectory = trial(tasks["support-1"], deck(5, 7, cross=True), engine)
    at_rest = (trajectory.time_s > 3.0) & (trajectory.time_s < 5.0)
    assert np.ptp(trajectory.cargo_position[at_rest, 2]) < 0.02


def test_a_rope_bears_what_hangs_on_it_and_gives_way_at_its_strength(engine) -> None:
    rig = Rig()
    tip = rig.row(rig.top, EAST, 3)[-1]
    load = rig.attach(tip, DOWN)
    for _ in range(4):
        rig.do("shift_block", block_id=load, shift_real=[0.0, 0.0, -0.5])
    rig.attach(rig.attach(load, DOWN, "Weight"), DOWN, "Weight")
    rig.connect(tip, load, DOWN, UP, connector="Winch")
    structure = structure_of(rig.machine)
    scenario = Scenario(duration_s=2.0, control=Control(mode="agent"))
    for limit, breaks in ((15.0, True), (60.0, False)):
        weak = replace(structure, ropes=replace(structure.ropes, limit=np.array([limit])))
        trajectory = simulate_structure(weak, scenario, engine)
        assert [one.kind for one in trajectory.breaks] == ["rope"] * breaks, limit
    # The block, two weights and half of the rope.
    rope = next(peak for peak in trajectory.joint_peaks if peak.kind == "rope")
    assert rope.force == pytest.approx(0.3 + 2 * 10 + 0.2, rel=0.03)
