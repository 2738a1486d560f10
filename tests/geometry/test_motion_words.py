"""What builders read of the free axes, wings and fans of further types."""

import pytest
from support.machines.building import built

from buildarena_geometry import module_set

CATALOGUE = module_set("workshop")


def line(module, face="A", twist=0.0, *, flip=False):
    """What is said of a module on a face of a starting block: A looks east, C up, E north."""
    machine = built(("1", face, module), catalogue=CATALOGUE)
    if twist:
        assert machine.act("twist_block", {"block_id": "2", "angle": twist}).ok
    if flip:
        assert machine.act("flip_spin", {"block_id": "2"}).ok
    return machine.act("get_block_details", {"block_id": "2"}).text.splitlines()[0]


@pytest.mark.parametrize(
    ("module", "face", "twist", "said"),
    [
        ("Hinge", "A", 0, "swings about <North>"),
        ("Hinge", "A", 90, "swings about <Down>"),
        ("Hinge", "A", 30, "swings about <North with -30° pitch>"),
        ("Hinge", "C", 0, "swings about <West>"),
        ("Swivel", "C", 0, "turns freely about <Up>"),
        ("Ball Joint", "A", 0, "turns freely every way"),
        ("Axle", "E", 0, "bends freely, shaft <North>"),
        ("Slider", "E", 45, "slides along <North>"),
        ("Suspension", "D", 0, "slides along <Down>"),
        ("Piston", "B", 0, "extend moves it <West>"),
        ("Steering Block", "A", 0, "turn_left turns it counterclockwise seen from outside"),
        ("Spinning Block", "A", 0, "always turns clockwise seen from outside"),
        ("Steering Hinge", "A", 0, "turn_right swings its far end <Up>"),
        ("Steering Hinge", "A", 90, "turn_right swings its far end <North>"),
        ("Steering Hinge", "A", 180, "turn_right swings its far end <Down>"),
        ("Wheel Unpowered", "A", 0, "turns freely about <East>"),
        ("Small Wheel", "D", 0, "turns freely about <West>"),
        ("Large Wheel", "A", 0, "forward rolls it <North>"),
        ("Fly Wheel", "A", 0, "forward rolls it <South>"),
        ("Wing Panel", "A", 0, "flat side faces <Up>"),
        ("Wing Panel", "A", 90, "flat side faces <North>"),
        ("Drag Block", "A", 0, "open to <Down>"),
        ("Flying Block", "D", 0, "fly pushes it <Down>"),
    ],
)
def test_directions_are_the_worlds(module, face, twist, said):
    told = line(module, face, twist).rstrip(".")
    assert said in told.split(", ") or told.endswith(said)


@pytest.mark.parametrize(
    ("module", "said"),
    [
        ("Steering Hinge", "turn_right swings its far end <Down> (flipped)"),
        ("Steering Block", "turn_left turns it clockwise seen from outside (flipped)"),
        ("Spinning Block", "always turns counterclockwise seen from outside (flipped)"),
        ("Large Wheel", "forward rolls it <South> (flipped)"),
    ],
)
def test_flipping_turns_them_round(module, said):
    assert line(module, flip=True).endswith(f"{said}.")


@pytest.mark.parametrize("module", ["Double Wooden Block", "Log", "Grip Pad", "Ballast", "Balloon"])
def test_nothing_is_said_of_what_has_no_direction(module):
    assert line(module).count(",") == 4  # its face, and three coordinates


def test_every_articulated_or_flying_type_says_something():
    silent = [
        name
        for name in CATALOGUE.attachable
        if (module := CATALOGUE[name]).joint or module.wing or module.push
        if line(name).count(",") == 4
    ]
    assert silent == []
