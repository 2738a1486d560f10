"""The actions that carry out many: `build`, and `mirror` over a plane through the start."""

import numpy as np
import pytest

from buildarena_geometry import Machine, module_set

BLOCK = "Small Wooden Block"


def attach(base: str, face: str, module: str = BLOCK) -> dict[str, object]:
    arguments = {"base_block": base, "face": face, "new_block": module}
    return {"tool": "attach_block_to", "arguments": arguments}


def connect(first: str, face_a: str, second: str, face_b: str) -> dict[str, object]:
    ends = {"block_a": first, "face_a": face_a, "block_b": second, "face_b": face_b}
    return {"tool": "connect_blocks", "arguments": {**ends, "connector": "Brace"}}


def bind(block: str, action: str, key: str) -> dict[str, object]:
    arguments = {"block_id": block, "action": action, "new_key": key}
    return {"tool": "change_control_key", "arguments": arguments}


START = {"tool": "start"}
AWAY = [attach("2", "E"), attach("3", "E")]


def test_a_batch_stops_at_the_first_refusal_and_keeps_what_came_before() -> None:
    machine = Machine()
    steps = [START, attach("1", "A"), attach("1", "A"), attach("1", "B")]
    outcome = machine.act("build", {"actions": steps})
    assert not outcome.ok
    assert 'Action 3 of 4 ("attach_block_to") was refused: Face A' in outcome.text
    assert list(machine.blocks) == ["1", "2"]
    single = Machine()
    for step in steps[:3]:
        single.act(step["tool"], step.get("arguments"))
    assert machine == single
    assert len(machine.log.records) == 3, "each action is recorded by itself"
    assert machine.act("BUILD", {"actions": [attach("1", "B")]}).ok


def test_a_batch_takes_building_actions_alone() -> None:
    machine = Machine()
    for tool in ("build", "set_controller", "list_modules", "submit"):
        outcome = machine.act("build", {"actions": [{"tool": tool, "arguments": {}}]})
        assert (outcome.ok, f'carries out no "{tool}"' in outcome.text) == (False, True)
    assert not machine.started


@pytest.mark.parametrize("plane", ["x", "y"])
def test_an_image_is_where_a_mirror_shows_it(plane) -> None:
    """Every face, connector and centre of mass of a machine, for all modules that can be."""
    sign = np.array([-1, 1, 1]) if plane == "x" else np.array([1, -1, 1])
    catalogue = module_set("workshop")
    for name in catalogue.attachable:
        machine = Machine(catalogue=catalogue)
        side = "A" if plane == "x" else "E"
        start = {"tool": "start", "arguments": {"init_shift": [2, -3, 1]}}
        machine.act("build", {"actions": [start, attach("1", side), *AWAY, attach("4", "C", name)]})
        machine.act("twist_block", {"block_id": "5", "angle": 30})
        machine.act("shift_block", {"block_id": "5", "shift_real": [0.1, 0.2, 0.1]})
        outcome = machine.act("mirror", {"plane": plane})
        if name in ("Propeller", "Small Propeller"):
            assert "not symmetric" in outcome.text
            continue
        assert outcome.ok, (name, outcome.text)
        block, image = machine.blocks["5"], machine.blocks["9"]
        origin = np.array([2, -3, 1])
        wanted = origin + (np.array(block.center_xyz) - origin) * sign
        assert image.center_xyz == pytest.approx(wanted, abs=1e-9)
        centers = [
            {tuple(np.round((b.world_from_block.apply(f.center) - origin) * s, 6) + 0.0)
             for f in b.module.faces}
            for b, s in ((block, sign), (image, np.ones(3)))
        ]  # fmt: skip
        assert centers[0] == centers[1], name


def test_a_mirrored_car_drives_by_the_same_keys() -> None:
    machine = Machine()
    wheel = attach("2", "A", "Powered Wheel")
    steps = [START, attach("1", "E"), wheel, bind("3", "spinning_forward", "UpArrow")]
    assert machine.act("build", {"actions": [*steps, connect("1", "C", "2", "C")]}).ok
    for plane in ("x", "y"):
        assert machine.act("mirror", {"plane": plane}).ok
    wheels = [block for block in machine.blocks.values() if block.module.spins]
    told = machine.act("review_powered_blocks", {}).text.splitlines()
    assert len(wheels) == 4
    assert {line.partition("forward rolls it ")[2].split(">")[0] for line in told} == {"<North"}
    assert all(wheel.bindings["spinning_forward"] == ("UpArrow",) for wheel in wheels)
    assert len(machine.connectors) == 2
    assert machine.center_of_mass[:2] == pytest.approx([0, 0])


def test_what_cannot_be_mirrored_is_refused_and_changes_nothing(subtests) -> None:
    machine = Machine()
    machine.act("build", {"actions": [START, attach("1", "A"), attach("2", "E"), attach("1", "B")]})
    before = machine.copy()
    for arguments, told in (
        ({"plane": "x"}, "is taken"),
        ({"plane": "y"}, "nothing to mirror"),
        ({"plane": "x", "block_ids": ["3"]}, "Mirror that block too"),
        ({"plane": "x", "block_ids": ["1"]}, "nothing to mirror"),
        ({"plane": "x", "block_ids": ["9"]}, "no block"),
        ({"plane": "z"}, 'must be "x" or "y"'),
        ({}, "Missing: plane"),
    ):
        with subtests.test(arguments=arguments):
            outcome = machine.act("mirror", arguments)
            assert (outcome.ok, told in outcome.text) == (False, True), outcome.text
            assert machine == before
    assert "first" in Machine().act("mirror", {"plane": "x"}).text


def test_the_summary_gives_mass_inertia_and_size_of_a_known_machine() -> None:
    machine = Machine()
    machine.act("build", {"actions": [START, attach("1", "A"), attach("1", "B")]})
    masses = [block.mass for block in machine.blocks.values()]
    along = sum(mass / 6 for mass in masses)
    across = along + sum(masses[1:])
    assert machine.state.inertia == pytest.approx([along, across, across])
    told = machine.act("get_machine_summary").text
    assert "Centre of mass [0, 0, 0]" in told
    assert "outer dimensions 3 x 1 x 1, from [-1.5, -0.5, -0.5] to [1.5, 0.5, 0.5]" in told
