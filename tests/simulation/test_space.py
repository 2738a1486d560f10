"""Fuel, and a planet: its pull, its air, and what turns and brakes there."""

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from support.machines.building import KeyedDraft, attach, built, connect
from support.marks import nightly

from buildarena_benchmark.experts.drafting import EAST, NORTH, SOUTH, UP, WEST
from buildarena_geometry import KeyPress, Machine, module_set
from buildarena_simulation import Scenario, simulate
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.machine import structure_of

RADIUS, PULL = 600.0, 23.0


ALL = module_set("all")


THRUST = 24 * GRAVITY


HZ = 25


def scenario(**fields: Any) -> Scenario:
    planet = {"radius": RADIUS, "air": 0} | fields.pop("planet", {})
    usual = {"duration_s": 4, "gravity": PULL, "control": {"mode": "agent"}, "planet": planet}
    return Scenario.model_validate(usual | fields)


def released(height: float, *velocity: float) -> dict[str, Any]:
    return {"kind": "released", "height": height, "velocity": velocity or (0, 0, 0)}


def bind(machine: Machine, block: str, action: str, key: str) -> None:
    done = machine.act("add_control_key", {"block_id": block, "action": action, "new_key": key})
    assert done.ok, done.text


def bound(machine: Machine, **keys: str) -> Machine:
    """The machine with a key for each action, on all blocks that have it."""
    for action, key in keys.items():
        for block in machine.blocks.values():
            if action in block.module.actions:
                bind(machine, block.id, action, key)
    return machine


def held(key: str, until_s: float, from_s: float = 0.0) -> KeyPress:
    return KeyPress(time_s=from_s, key=key, hold_for_s=until_s - from_s)


def path(trial: Any) -> np.ndarray:
    """Where the middle of all blocks is, (T, 3), from the planet's centre."""
    return trial.positions.astype(float).mean(axis=1) + np.array([0, 0, RADIUS])


@pytest.mark.ci
@pytest.mark.nightly(engine="pybullet")
def test_a_free_fall_round_the_planet_keeps_keplers_laws(engine) -> None:
    radius = RADIUS + 400.5
    speed = 1.1 * math.sqrt(PULL * RADIUS**2 / radius)
    axis = 1 / (2 / radius - speed**2 / (PULL * RADIUS**2))
    period = 2 * math.pi * math.sqrt(axis**3 / (PULL * RADIUS**2))
    lasts = math.ceil(3.05 * period * HZ) / HZ
    world = scenario(duration_s=lasts, placement=released(400, speed, 0, 0))
    trial = simulate(built(), world, engine, controls=())
    arms = path(trial)
    away = np.linalg.norm(arms, axis=1)
    velocity = np.gradient(arms, 1 / HZ, axis=0)
    energy = (velocity**2).sum(axis=1) / 2 - PULL * RADIUS**2 / away
    momentum = np.linalg.norm(np.cross(arms, velocity), axis=1)
    for kept in (energy[5:-5], momentum[5:-5]):
        assert np.ptp(kept) < 0.005 * abs(kept[0])
        assert abs(kept[-1] / kept[0] - 1) < 0.0005
    angle = np.unwrap(np.arctan2(arms[:, 0], arms[:, 2]))
    assert np.interp(6 * math.pi, angle, trial.time_s) == pytest.approx(3 * period, rel=0.001)


def rocket(tank: str = "Fuel Barrel Big") -> Machine:
    machine = built(("1", "D", tank), catalogue=ALL)
    assert attach(machine, "2", "J" if tank.endswith("Big") else "E", "Booster").ok
    return bound(machine, thrust="Alpha1")


@pytest.mark.parametrize(
    ("tank", "burn_s"), [("Fuel Barrel", 8.0), nightly("Fuel Barrel Big", 40.0)]
)
def test_the_rocket_equation_holds_as_fuel_is_used_up(engine, tank, burn_s) -> None:
    machine = rocket(tank)
    blocks = structure_of(machine)
    fuel, mass = (
        sum(getattr(part.module.tank, name) for part in blocks.parts if part.module.tank)
        for name in ("fuel", "mass")
    )
    full = float(blocks.masses.sum())
    rate = mass / fuel
    empty = full - rate * burn_s
    lasts = burn_s + 1
    world = scenario(duration_s=lasts, gravity=5, planet={"radius": 1e4}, placement=released(1000))
    trial, calm = (
        simulate(machine, world, engine, controls=keys) for keys in ([held("Alpha1", burn_s)], ())
    )
    speeds = np.diff(trial.positions[:, 0, 2].astype(float)) * HZ
    # The pull that it feels on its way, by its own path.
    radius = trial.positions[:-1, 0, 2].astype(float) + 1e4
    lost = float((5 * (1e4 / radius) ** 2).sum() / HZ)
    assert speeds[-1] + lost == pytest.approx(THRUST / rate * math.log(full / empty), rel=0.005)
    assert calm.positions[-1, 0, 2] < 1000
    assert not trial.breaks


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
def test_fuel_ends_and_flows_through_what_holds_fuel_alone(engine) -> None:
    own, barrel = 1.0, 10.0
    joined = rocket("Fuel Barrel")
    apart = built(("1", "D", "Booster"), ("1", "C", "Fuel Barrel"), catalogue=ALL)
    hosed = apart.copy()
    for side in "AB":  # one on each side, lest it tumbles
        assert connect(hosed, "2", side, "3", "E", connector="Fuel Line").ok
    for machine, burns_s in ((joined, own + barrel), (apart, own), (hosed, own + barrel)):
        bound(machine, thrust="Alpha1")
        world = scenario(duration_s=14, gravity=5, planet={"radius": 1e4}, placement=released(1000))
        trial = simulate(machine, world, engine, controls=[held("Alpha1", 13)])
        climb = np.diff(trial.positions[:, 0, 2].astype(float)) * HZ
        pushed = np.flatnonzero(np.diff(climb) * HZ > 50)
        assert trial.time_s[pushed[-1]] == pytest.approx(burns_s, abs=0.1)


@pytest.mark.parametrize("chute", [False, True])
def test_speeds_of_fall_in_air(engine, chute) -> None:
    machine = built(("1", "C", "Parachute"), catalogue=ALL) if chute else built()
    if chute:
        machine = bound(machine, deploy="Alpha1")
    blocks = structure_of(machine)
    mass = float(blocks.masses.sum())
    drag = float(blocks.linear_drag @ blocks.masses)
    # v drag + v² of the parachute's bear the weight.
    falls = PULL * mass / drag
    if chute:
        falls = (-drag + math.sqrt(drag**2 + 4 * PULL * mass)) / 2
    world = scenario(
        duration_s=2,
        planet={"radius": 1e4, "air": 1, "air_height": 1e4},
        placement=released(250, 0, 0, -falls if not chute else -5),
    )
    trial = simulate(machine, world, engine, controls=[held("Alpha1", 0.2)])
    climb = np.diff(trial.positions[:, 0, 2].astype(float)) * HZ
    assert climb[-1] == pytest.approx(-falls, rel=0.03)


def test_air_thins_out_evenly_up_to_its_end(engine) -> None:
    def slowed(height: float, **planet: float) -> float:
        world = scenario(
            duration_s=1,
            placement=released(height, 50, 0, 0),
            planet={"radius": 1e4, "air_height": 300} | planet,
        )
        trial = simulate(built(), world, engine, controls=())
        return 1 - float(trial.positions[-1, 0, 0] / 50)

    usual = slowed(10, air=1)
    assert usual == pytest.approx(0.2 / 2 * (1 - 10 / 300), rel=0.1)
    assert slowed(150, air=1) == pytest.approx(usual / 2, rel=0.1)
    assert slowed(150, air=0.5) == pytest.approx(usual / 4, rel=0.1)
    assert abs(slowed(400, air=1)) < 1e-3


def test_a_flywheel_turns_by_what_it_takes_up_and_no_further(engine) -> None:
    machine = built(("1", "C", "Reaction Steering Block"), catalogue=ALL)
    for face in "ABEF":
        assert attach(machine, "1", face, "Log").ok
    machine = bound(machine, turn_left="Alpha1", turn_right="Alpha2")
    blocks = structure_of(machine)
    middle = blocks.masses @ blocks.positions / blocks.masses.sum()
    arms = blocks.centers_of_mass - middle
    inertia = float(blocks.inertias[:, 2, 2].sum() + blocks.masses @ (arms[:, :2] ** 2).sum(axis=1))
    world = scenario(duration_s=6, placement=released(500))
    torque = 2 * GRAVITY

    def spins(*keys: KeyPress) -> np.ndarray:
        trial = simulate(machine, world, engine, controls=list(keys))
        turns = trial.quaternions[:, 0].astype(float)
        return np.diff(np.unwrap(2 * np.arctan2(turns[:, 3], turns[:, 0]))) * HZ

    turned = spins(held("Alpha1", 0.08))
    assert turned[1] == pytest.approx(torque * 0.06 / inertia, rel=0.05)
    assert abs(turned[-1]) < 0.02 * turned[1]  # it brakes by itself
    long = spins(held("Alpha1", 5.9))
    assert long.max() == pytest.approx(60 / inertia, rel=0.1)  # the wheel spins as fast as it can
    assert spins(held("Alpha2", 0.08))[1] == pytest.approx(-turned[1], rel=0.01)


def test_nozzles_push_without_air_both_ways_and_steady_what_turns(engine) -> None:
    machine = built(catalogue=ALL)
    for face in "AB":
        assert attach(machine, "1", face, "Steering Thruster").ok
    ups = [float(np.array(machine.blocks[b].world_from_block.rotation)[2, 1]) for b in ("2", "3")]
    if abs(ups[0] + ups[1]) < 1:
        assert machine.act("twist_block", {"block_id": "3", "angle": 180}).ok
    bound(machine, thrust_left="Alpha1")
    bind(machine, "2", "thrust_right", "Alpha2")
    bind(machine, "3", "thrust_right", "Alpha3")
    mass = float(structure_of(machine).masses.sum())
    world = scenario(duration_s=2, placement=released(500))
    way = np.array(machine.blocks["2"].world_from_block.rotation)[:, 1]

    def gained(*keys: KeyPress) -> np.ndarray:
        """The speed that it has gained along the nozzles' way, and how fast it turns."""
        trials = [simulate(machine, world, engine, controls=of) for of in (keys, ())]
        ends = [path(trial)[:, :] @ way for trial in trials]
        speed = np.diff(ends[0] - ends[1]) * HZ
        turns = trials[0].quaternions[:, 0].astype(float)
        moved = np.abs((turns[1:] * turns[:-1]).sum(axis=1)).clip(0, 1)
        return np.array([speed[-1], 2 * np.arccos(moved[-1]) * HZ])

    push = 2 * 0.767 * GRAVITY / mass
    assert gained(held("Alpha1", 1.0))[0] == pytest.approx(push, rel=0.03)
    both = gained(held("Alpha2", 1.0), held("Alpha3", 1.0))
    assert both[0] == pytest.approx(-push, rel=0.03)
    # One alone turns it; once it is let go the nozzles stop the turning.
    turning = gained(held("Alpha2", 2.0))[1]
    assert turning > 2
    assert gained(held("Alpha2", 0.5))[1] < 0.02 * turning


def test_what_no_planet_has_is_refused_by_its_name() -> None:
    for fields, what in (
        ({"terrain": [{"center": [0, 0, 1], "size": [1, 1, 1]}]}, "terrain"),
        ({"gusts": {"strength": 1}}, "gusts"),
        ({"fuel_s": 3}, "fuel_s"),
        ({"placement": {"kind": "span", "gap": 5}}, "placement.kind span"),
        ({"planet": {"radius": 1}}, "radius"),
        ({"planet": {"radius": math.nan}}, "radius"),
        ({"planet": {"moons": 2}}, "moons"),
    ):
        with pytest.raises(ValidationError, match=what):
            scenario(**fields)


def fuelled(**fields: Any) -> Scenario:
    return Scenario.model_validate(
        {"duration_s": 3, "placement": released(500), "control": {"mode": "agent"}}
        | {"senses": {"offers": ["fuel"]}}
        | fields
    )


def craft() -> KeyedDraft:
    draft = KeyedDraft(modules="workshop")
    middle = draft.start()
    for way in (NORTH, EAST, SOUTH, WEST):
        fan = draft.attach(draft.row(middle, way, 1)[-1], UP, "Flying Block")
        draft.bind(fan, "fly", "Alpha1")
    return draft


def share_of_weight() -> float:
    """What all fans push, in weights of the machine."""
    return 4 * 3.25 / float(structure_of(craft().machine).masses.sum())


def gained(trial: Any, calm: Any) -> np.ndarray:
    """How much faster upwards than without a push, at each sample but the first, in weights·s."""
    apart = (trial.positions - calm.positions).astype(float).mean(axis=1)[:, 2]
    return np.diff(apart) * 25 / GRAVITY


@pytest.mark.parametrize("share", [0.4, 1.0])
def test_fans_push_until_it_is_burnt(engine, share) -> None:
    program = f"function control() return {{ fly = {share} }} end"
    machine = craft().machine
    calm = simulate(machine, fuelled(), engine, controls=())
    trial = simulate(machine.with_controller(program), fuelled(fuel_s=1), engine)
    end = 25 / (share * share_of_weight())
    assert end < 40
    speed = gained(trial, calm)
    # It is burnt tick by tick: the last one counts in full or not at all; the air takes some.
    first = round(end) + 1
    assert speed[first] == pytest.approx(1.0, abs=0.12)
    assert (np.diff(speed[first:]) < 1e-3).all()
    assert speed[int(end) - 3] < speed[first]
    tank = trial.piloting.senses[:-1, 0]
    assert trial.piloting.sense_names == ("fuel",)
    assert tank[0] == 1
    assert (np.diff(tank) <= 0).all()
    assert tank[5] == pytest.approx(1 - 0.2 * share * share_of_weight(), abs=1e-5)
    assert tank[-1] == 0


def test_keys_burn_as_much_as_programs(engine) -> None:
    draft = craft()
    draft.press("Alpha1", 0.0, 3.0)
    by_key = simulate(draft.machine, fuelled(fuel_s=1, senses=None), engine)
    program = "function control() return { fly = 1 } end"
    asked = simulate(craft().machine.with_controller(program), fuelled(fuel_s=1), engine)
    assert by_key.positions == pytest.approx(asked.positions, abs=1e-4)
    for_ever = simulate(draft.machine, fuelled(senses=None), engine)
    assert for_ever.positions[-1, 0, 2] > by_key.positions[-1, 0, 2] + 20


def test_cannons_burn_it_as_if_they_were_heated(engine) -> None:
    draft = KeyedDraft(modules="workshop")
    draft.bind(draft.cannon(draft.start(), EAST, UP), "hold_to_fire", "Alpha1")
    draft.press("Alpha1", 0.0, 3.0)
    trials = [
        simulate(draft.machine, fuelled(senses=None, fuel_s=fuel), engine).positions[-1, 0]
        for fuel in (None, 60, 0.5)
    ]
    assert trials[0] == pytest.approx(trials[1], abs=1e-6)
    assert np.linalg.norm(trials[2] - trials[0]) > 1
