"""Machine files hold what the published library saves, for 60 machines in every setting."""

import json
import math
import subprocess
import sys

import pytest
from tests.besiege.golden import dangles, golden, goldens, played_document, scenario_of, task_of

from buildarena_benchmark import builtin_tasks
from buildarena_besiege.__main__ import main
from buildarena_besiege.normal import normal_form
from buildarena_geometry import KeyPress, Machine
from buildarena_geometry.rotations import multiply

TOLERANCE = 1e-6
EXPORTS = [
    pytest.param(one.name, index, id=f"{one.name}-{export['category']}-{export['level']}")
    for one in goldens()
    for index, export in enumerate(one.exports)
]
ENDS = ("start-rotation", "end-rotation")


@pytest.mark.parametrize(("name", "index"), EXPORTS)
def test_an_export_is_the_published_one(name, index) -> None:
    found = golden(name)
    theirs = found.exports[index]
    ours = normal_form_of(found, theirs)
    assert (ours["category"], ours["level"]) == (theirs["category"], theirs["level"])
    assert ours["refused"] == theirs["refused"]
    if theirs["refused"]:
        assert set(ours) == {"category", "level", "refused"}
        return
    for part in ("machine", "run"):
        assert ours[part] == theirs.get(part)
    assert ours["data"] == theirs["data"]
    left_out = {b["local_id"] for b in theirs["blocks"] if missing(found, b)}
    gaps = set(theirs["connector_gaps"])
    blocks = {block["local_id"]: block for block in ours["blocks"]}
    assert next(iter(blocks)) == theirs["blocks"][0]["local_id"]
    assert ("Ballast" in blocks) == (list(blocks)[-1] == "Ballast")
    assert blocks.keys() == {block["local_id"] for block in theirs["blocks"]} - left_out
    for block in theirs["blocks"]:
        if block["local_id"] in left_out:
            continue
        stale = block["local_id"] in gaps or (
            block["local_id"] == "Ballast" and (theirs.get("centres_stale") or left_out)
        )
        assert_same_block(blocks[block["local_id"]], block, stale=stale)
    if not left_out:
        assert_same_place(ours, theirs)
    if theirs["category"] in ("transport", "support"):
        assert set(ours["tracked"]) == set(theirs["tracked"])


def test_exports_differ_from_the_published_ones_in_few_parts() -> None:
    """The comparison above leaves things out; it must not leave out much."""
    all_exports = [e for one in goldens() for e in one.exports if not e["refused"]]
    gaps = sum(len(e["connector_gaps"]) for e in all_exports)
    parts = sum(len(e["blocks"]) for e in all_exports)
    assert len(all_exports) > 270
    assert gaps / parts < 0.05


def test_the_command_prints_the_normal_form(tmp_path, capsys) -> None:
    file = tmp_path / "machine.json"
    found = golden("single-9")
    export = next(e for e in found.exports if e["category"] == "transport")
    file.write_text(json.dumps(played_document(found, export)), encoding="utf-8")
    assert main(["export", str(file), "--task", task_of(export)]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads(json.dumps(normal_form_of(found, export)))
    assert main(["export", str(file)]) == 0
    assert json.loads(capsys.readouterr().out)["category"] == "plain"


@pytest.mark.parametrize(
    ("text", "words", "says"),
    [
        ("{}", (), "neither a machine document nor an action log"),
        ("[1]", (), "a list of objects"),
        ("{", (), "not valid JSON"),
        ("<Machine/>", (), "no blocks"),
        ("[]", ("--task", "lift-9"), "no task 'lift-9'; there are transport-1"),
    ],
)
def test_the_command_says_what_is_wrong(tmp_path, capsys, text, words, says) -> None:
    file = tmp_path / "machine.json"
    file.write_text(text, encoding="utf-8")
    assert main(["export", str(file), *words]) == 1
    assert says in capsys.readouterr().err


def test_the_command_reads_standard_input() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "buildarena_besiege", "export", "-", "--task", "support-1"],
        input='[{"op": "start", "params": {}}]',
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(done.stdout)["refused"] == "only a starting block"


def test_an_empty_machine_is_refused_with_a_sentence() -> None:
    assert normal_form(Machine())["refused"] == "The machine has no blocks."


def normal_form_of(found, export):
    document = played_document(found, export)
    machine = Machine.from_document(document)
    if export["category"] == "plain":
        return normal_form(machine)
    task = builtin_tasks()[task_of(export)]
    assert task.scenario == scenario_of(export)
    return normal_form(machine, task.scenario, category=task.category, level=task.level)


def missing(found, block) -> bool:
    """Whether it is a connector on a removed block: our library removes it with the block."""
    return any(one["id"] == block["local_id"] and dangles(one) for one in found.state["blocks"])


def assert_same_block(ours, theirs, *, stale) -> None:
    where = theirs["local_id"]
    assert (ours["name"], ours["id"]) == (theirs["name"], theirs["id"]), where
    assert near(ours["scale"], theirs["scale"]), where
    if not stale:
        assert near(ours["position"], theirs["position"]), where
        assert same_turn(ours["rotation_xyzw"], theirs["rotation_xyzw"]), where
    assert [entry[:2] for entry in ours["data"]] == [entry[:2] for entry in theirs["data"]], where
    for (kind, key, value), (_, _, wanted) in zip(ours["data"], theirs["data"], strict=True):
        if key in ENDS:
            assert stale or same_turn(zyz(value), zyz(wanted)), (where, key)
        elif kind == "Vector3":
            assert stale or near(value, wanted), (where, key)
        else:
            assert value == wanted, (where, key)
            assert type(value) is type(wanted), (where, key)


def assert_same_place(ours, theirs) -> None:
    current = theirs.get("placement_current_centres", {})
    ours_at, turn = ours["global"]["position"], ours["global"]["rotation_xyzw"]
    if "turned" in current:
        if current["margin"] > TOLERANCE:
            wanted = math.sqrt(0.5) if current["turned"] else 0.0
            assert near(turn, [0.0, wanted, 0.0, wanted or 1.0])
            assert near(ours_at, current["centred"])
        return
    assert near(turn, theirs["global"]["rotation_xyzw"])
    stale = theirs.get("centres_stale")
    assert near(ours_at, current["upstream_rule"] if stale else theirs["global"]["position"])
    if stale and "Ballast" in {block["local_id"] for block in ours["blocks"]}:
        assert near(ours["blocks"][-1]["position"], current["cargo_root"])


def near(left, right) -> bool:
    return all(abs(a - b) <= TOLERANCE for a, b in zip(left, right, strict=True))


def same_turn(left, right) -> bool:
    return near(left, right) or near(left, [-value for value in right])


def zyz(angles):
    """The quaternion of a connector's end: its angles are defined in part only."""
    first, tilt, last = (math.radians(one) / 2 for one in (angles[0] - 270.0, *angles[1:]))

    def about_z(half):
        return (math.cos(half), 0.0, 0.0, math.sin(half))

    return multiply(
        multiply(about_z(first), (math.cos(tilt), 0.0, math.sin(tilt), 0.0)), about_z(last)
    )


def test_the_presses_of_a_golden_machine_are_key_presses() -> None:
    found = golden("single-9")
    export = next(e for e in found.exports if e["category"] == "transport")
    _, presses = found.played(export)
    assert presses == [KeyPress(time_s=1, key="UpArrow", hold_for_s=1)]
