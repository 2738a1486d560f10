"""Mass, centre of mass, bounds."""

import numpy as np
import pytest
from support.machines.building import connect

from buildarena_geometry import Machine


def test_the_center_of_mass_weighs_blocks_and_connectors(build):
    machine = build(("1", "A", "Small Wooden Block"), ("1", "C", "Torch"))
    connect(machine, "1", "E", "2", "B")
    link = machine.connectors["4"]
    middle = (link.start_point + link.end_point) / 2
    weighed = 0.3 * np.array((1, 0, 0)) + 1.0 * np.array((0, 0, 1)) + 0.5 * middle
    assert np.allclose(machine.center_of_mass, weighed / (0.25 + 0.3 + 1.0 + 0.5))


def test_bounds_enclose_the_bodies_and_not_the_colliders(build):
    machine = build(("1", "A", "Powered Wheel"))
    assert np.allclose(machine.bounds, [(-0.5, -1, -1), (1.0, 1, 1)])


def test_bounds_of_a_turned_machine_are_those_of_its_turned_bodies(build):
    machine = build(init_rotation=[45, 0, 0])
    half = 0.5 * 2**0.5
    assert np.allclose(machine.bounds, [(-half, -half, -0.5), (half, half, 0.5)])


def test_a_turned_wheels_bounds_are_those_of_a_cylinder(build):
    machine = build(("1", "A", "Powered Wheel"), init_rotation=[45, 0, 0])
    # The disc stands upright and diagonal: its rim reaches 1 up, and 1/sqrt(2) to each side.
    assert machine.bounds[1, 2] == pytest.approx(1.0)
    rim = 0.5**0.5
    outer = 1.0 * rim  # the outer end's centre lies 1.0 along the axle from the starting block
    assert machine.bounds[1, 0] == pytest.approx(outer + rim)


def test_an_empty_machine_has_neither():
    with pytest.raises(ValueError, match="no bounds"):
        _ = Machine().bounds
    with pytest.raises(ValueError, match="no center of mass"):
        _ = Machine().center_of_mass
