"""A cargo that lands bounces, and its blow breaks a beam, as in a log of the game."""

import numpy as np
import pytest
from support.landings import (
    BEGINS_S,
    FALL_HEIGHT,
    cargo_path,
    in_game,
    landing_figures,
)
from support.machines.families import beam, deck
from support.machines.trials import trial

from buildarena_simulation import simulate
from buildarena_simulation.constants import BOUNCE_MASS, CARGO_BOUNCE, MIN_LANDING_SPEED


@pytest.mark.nightly(keep=1)
def test_the_beam_of_seven_fails_as_in_the_game(engine, tasks) -> None:
    scenario = in_game(tasks["support-1"].scenario)
    trajectory = simulate(beam(7), scenario, engine)
    figures = landing_figures(*cargo_path(trajectory, scenario), lost_below=FALL_HEIGHT)
    assert figures["contact_s"] == pytest.approx(0.54, abs=0.06)
    assert figures["peak"] == pytest.approx(6.66, abs=0.25)
    assert figures["peak_s"] == pytest.approx(0.82, abs=0.06)
    assert figures["again_s"] == pytest.approx(1.06, abs=0.08)
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


def test_a_cargo_bounces_less_on_a_heavier_machine(engine, tasks) -> None:
    scenario = tasks["support-1"].scenario.model_copy(update={"duration_s": 1.2})
    peaks = []
    for machine in (beam(7, "tb"), deck(5, 7, cross=True)):
        _, height = cargo_path(simulate(machine, scenario, engine), scenario)
        first = int(height[:20].argmin())
        peaks.append(height[first:].max() - height[first])
    assert peaks[1] < 0.6 * peaks[0]
