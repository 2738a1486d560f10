"""Courses that are driven, and a well: the expert's, and what a newcomer tries first."""

from __future__ import annotations

from typing import Any, Final

import pytest
from support.machines.drafts import KeyedDraft
from support.machines.headroom import drafted
from support.machines.piloted import FASTER_FIRST, scored

from buildarena_benchmark import builtin_tasks
from buildarena_geometry import Machine
from buildarena_simulation import MachineNotSimulable
from buildarena_worker.builtin.designs import DESIGNS, vehicles
from buildarena_worker.builtin.designs.drafting import EAST, NORTH, UP, WEST

COURSES: Final = ("drive-1", "drive-2", "drive-3", "drive-4", "fetch-1")


def tried(name: str, machine: Machine, engine: str = "mujoco") -> Any:
    return scored(builtin_tasks()[name], machine, engine, None)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("name", COURSES)
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_the_expert_passes(engine, name) -> None:
    result = tried(name, drafted(DESIGNS[name](0)), engine)
    assert result.success
    assert result.flags == ()


def straight(*, track: int = 1, seconds: float = 19.0) -> Machine:
    """A car that drives north and never steers."""
    presses = [("UpArrow", 0.4, seconds)]
    return drafted(vehicles._vehicle(length=5, track=track, deck=None, presses=presses))


@pytest.mark.nightly
def test_who_never_steers_does_not_get_through(subtests) -> None:
    """Wider than the gap it stays before that; along the track walls turn it once, not twice."""
    for name in ["drive-3", "drive-4"]:
        with subtests.test(name=name):
            assert not tried(name, straight()).success


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("seed", [1, 3, 2])
def test_a_car_whose_wheels_bear_in_turns_has_driven(seed) -> None:
    """Large wheels on its rear ones lift these, so that it rocks on the front ones."""
    car = straight()
    wheels = [name for name, block in car.blocks.items() if block.module.motor]
    for rear in sorted(wheels, key=lambda name: car.blocks[name].center[1])[:2]:
        hub = {"base_block": rear, "face": "E", "new_block": "Large Wheel"}
        assert car.act("attach_block_to", hub).ok
    result = scored(builtin_tasks()["drive-2"], car, "mujoco", seed)
    assert (result.success, result.flags) == (True, ())


@pytest.mark.nightly
def test_a_tower_that_topples_over_the_gates_drives_nothing() -> None:
    """Its mass gets over the first two lines of drive-2, and its wheels turn in the air."""
    draft = KeyedDraft(modules="workshop")
    base = draft.start()
    for side in (EAST, WEST):
        draft.bind(draft.wheel(base, side), "spinning_forward", "UpArrow")
    draft.attach(draft.row(base, UP, 30)[-1], NORTH, "Log")
    draft.press("UpArrow", 0.5, 0.3)
    result = tried("drive-2", draft.machine)
    assert not result.success
    assert result.indicator == 0


@pytest.mark.nightly
def test_a_weight_that_is_let_lie_is_not_fetched() -> None:
    """The crane without keys, and one that only takes hold."""
    for presses in ([], [(0.6, "RightArrow", 0.38)]):
        result = tried("fetch-1", drafted(DESIGNS["fetch-1"](0), presses))
        assert not result.success
        assert result.metrics["distance_to_mark"] > 15


@pytest.mark.nightly
def test_a_weight_that_is_dropped_over_the_mark_is_not_put_down() -> None:
    """Let go at the top of its way it falls for itself by more than 3."""
    machine = drafted(
        DESIGNS["fetch-1"](0),
        [(0.6, "RightArrow", 0.38), (2.6, "LeftArrow", 3.0), (9.0, "Alpha1", 0.2)],
    )
    result = tried("fetch-1", machine)
    assert not result.success
    assert result.metrics["loose_way"] > 3


def test_a_machine_in_the_well_is_refused() -> None:
    draft = KeyedDraft(modules="workshop")
    draft.row(draft.row(draft.start(), NORTH, 4)[-1], WEST, 8)
    with pytest.raises(MachineNotSimulable, match="overlaps terrain"):
        tried("fetch-1", draft.machine)
