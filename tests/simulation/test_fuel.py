"""Fuel: for how long fans and cannons may push, whoever asks and on either engine."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from support.machines.drafts import KeyedDraft

from buildarena_simulation import Scenario, simulate
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.machine import structure_of
from buildarena_worker.builtin.designs.drafting import EAST, NORTH, SOUTH, UP, WEST

FALL = {"kind": "released", "height": 500}
AGENT = {"mode": "agent"}
FAN: float = 3.25
"""What a fan pushes, mass·g."""


def scenario(**fields: Any) -> Scenario:
    return Scenario.model_validate(
        {"duration_s": 3, "placement": FALL, "control": AGENT, "senses": {"offers": ["fuel"]}}
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
    return 4 * FAN / float(structure_of(craft().machine).masses.sum())


def gained(trial: Any, calm: Any) -> np.ndarray:
    """How much faster upwards than without a push, at each sample but the first, in weights·s."""
    apart = (trial.positions - calm.positions).astype(float).mean(axis=1)[:, 2]
    return np.diff(apart) * 25 / GRAVITY


@pytest.mark.parametrize("share", [1.0, 0.4])
def test_fans_push_until_it_is_burnt(engine, share) -> None:
    program = f"function control() return {{ fly = {share} }} end"
    machine = craft().machine
    calm = simulate(machine, scenario(), engine, controls=())
    trial = simulate(machine.with_controller(program), scenario(fuel_s=1), engine)
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
    by_key = simulate(draft.machine, scenario(fuel_s=1, senses=None), engine)
    program = "function control() return { fly = 1 } end"
    asked = simulate(craft().machine.with_controller(program), scenario(fuel_s=1), engine)
    assert by_key.positions == pytest.approx(asked.positions, abs=1e-4)
    for_ever = simulate(draft.machine, scenario(senses=None), engine)
    assert for_ever.positions[-1, 0, 2] > by_key.positions[-1, 0, 2] + 20


def test_cannons_burn_it_as_if_they_were_heated(engine) -> None:
    draft = KeyedDraft(modules="workshop")
    draft.bind(draft.cannon(draft.start(), EAST, UP), "hold_to_fire", "Alpha1")
    draft.press("Alpha1", 0.0, 3.0)
    trials = [
        simulate(draft.machine, scenario(senses=None, fuel_s=fuel), engine).positions[-1, 0]
        for fuel in (None, 60, 0.5)
    ]
    assert trials[0] == pytest.approx(trials[1], abs=1e-6)
    assert np.linalg.norm(trials[2] - trials[0]) > 1


def test_a_seed_draws_it_and_it_is_no_part_of_other_scenarios() -> None:
    drawn = scenario(fuel_s=7, draws={"fuel_s": [6, 9]})
    fuels = [drawn.world(seed).fuel_s for seed in range(30)]
    assert len(set(fuels)) == 30
    low, high = min(fuels), max(fuels)
    assert 6 <= low < 6.5
    assert 8.5 < high <= 9
    assert drawn.world(None).fuel_s == 7
    assert "fuel_s" not in scenario().model_dump(mode="json")
    with pytest.raises(ValidationError, match="there is no 'fuel_s'"):
        scenario(draws={"fuel_s": [6, 9]})
    with pytest.raises(ValidationError, match="fuel_s"):
        scenario(fuel_s=-1)


def test_without_fuel_none_is_sensed(engine) -> None:
    program = "function control(t, sense) assert(sense.fuel == nil) return { fly = 1 } end"
    simulate(craft().machine.with_controller(program), scenario(duration_s=0.2), engine)
