"""Lift: what is not joined to the starting block counts for nothing. Trajectories made by hand."""

from dataclasses import replace

import numpy as np
import pytest
from support.machines.building import attach, built, connect
from tests.benchmark.conftest import make_trajectory, with_pieces

from buildarena_benchmark import score
from buildarena_benchmark.scorers.measures.components import joined_to_start
from buildarena_geometry import Machine
from buildarena_simulation.trajectory import Break


def _engine(*sprays: int) -> Machine:
    """A starting block with a cannon on each of its faces A, B, E, F, turned by quarter turns."""
    machine = built(*(("1", face, "Water Cannon") for face, _ in zip("ABEF", sprays, strict=False)))
    for block, turns in zip([*machine.blocks][1:], sprays, strict=True):
        if turns:
            turned = machine.act("twist_block", {"block_id": block, "angle": 90.0 * turns})
            assert turned.ok, turned.text
    return machine


def _turns_down() -> list[int]:
    """How many quarter turns make each of four cannons spray down."""
    turns = []
    for place in range(4):
        for turn in range(4):
            tried = _engine(*([0] * place), turn)
            if tried.blocks[str(place + 2)].pointing[2] < -0.99:
                turns.append(turn)
    return turns


DOWN = _turns_down()


def test_cannons_that_push_against_each_other_cancel(tasks) -> None:
    together = _engine(*DOWN)
    against = _engine(*(turn + 2 * (place % 2) for place, turn in enumerate(DOWN)))
    three = _engine(*(turn + 2 * (place == 0) for place, turn in enumerate(DOWN)))
    for machine, net in ((together, 4.0), (against, 0.0), (three, 2.0)):
        trial = make_trajectory(machine, 10.0, heated=[True] * 4)
        result = score(tasks["lift-1"], machine, trial)
        assert result.indicator == pytest.approx(net * 13.76 / 6.25, abs=1e-5)
        assert result.success == (net > 0)


def test_cannons_at_a_right_angle_add_as_arrows(tasks) -> None:
    machine = _engine(DOWN[0], DOWN[1] + 1)
    result = score(tasks["lift-1"], machine, make_trajectory(machine, 10.0, heated=[True, False]))
    assert result.indicator == pytest.approx(np.hypot(13.76, 1.6) / 3.25, abs=1e-5)


def test_an_order_of_cannons_changes_nothing(tasks) -> None:
    machine = _engine(*DOWN)
    results = {
        score(tasks["lift-1"], machine, make_trajectory(machine, 10.0, heated=hot)).indicator
        for hot in ([True, False, True, True], [True, True, True, False])
    }
    assert len(results) == 1


def test_a_cannon_that_breaks_off_no_longer_counts(tasks) -> None:
    machine = _engine(*DOWN)
    whole = make_trajectory(machine, 10.0, heated=[True] * 4)
    broken = with_pieces(whole, ["2"], since_s=5.0)
    result = score(tasks["lift-1"], machine, broken)
    # Its weight still counts, so that nothing is gained by parts that come off.
    assert result.indicator == pytest.approx(3 * 13.76 / 6.25, abs=1e-5)
    never = with_pieces(whole, ["2"])
    left = score(tasks["lift-1"], machine, never).indicator
    assert left == pytest.approx(3 * 13.76 / 4.75, abs=1e-5)
    alone = with_pieces(whole, ["2"], ["3"], ["4"], ["5"])
    assert score(tasks["lift-1"], machine, alone).indicator == 0.0


def _flight(machine: Machine, flying: set[str], heated: int):
    trial = make_trajectory(machine, 30.0, heated=[True] * heated)
    positions = trial.positions.copy()
    for column, block in enumerate(trial.block_ids):
        if block in flying:
            positions[:, column, 2] += 8.0 * np.maximum(trial.time_s - 2.0, 0.0)
    return replace(trial, positions=positions)


def test_a_cannon_that_flies_alone_lifts_nothing(tasks) -> None:
    machine = _engine(*DOWN)
    torn = with_pieces(_flight(machine, {"2"}, 4), ["2"], since_s=2.0)
    result = score(tasks["lift-2"], machine, torn)
    assert not result.success
    assert result.indicator < 3.0
    assert score(tasks["lift-2"], machine, replace(torn, pieces=None)).indicator > 200.0


def test_a_rocket_that_loses_a_part_goes_on(tasks) -> None:
    machine = _engine(*DOWN)
    flight = _flight(machine, {"1", "2", "3", "4"}, 4)
    result = score(tasks["lift-2"], machine, with_pieces(flight, ["5"], since_s=2.0))
    assert result.success
    assert result.flags == ()


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
