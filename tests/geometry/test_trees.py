"""Construction trees: what is read, how it is built, and what wrong entries are told."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from buildarena_geometry import DocumentError, Machine, module_set
from buildarena_geometry.besiege_components import besiege_rotation
from buildarena_geometry.errors import TreeError
from buildarena_geometry.trees import (
    MAX_ENTRIES,
    POINTING,
    looks_like_tree,
    point_text,
    points_of,
    read_tree,
    tree_actions,
    tree_in,
)

ROOT = {"id": "0", "order_id": 0, "parent": -1, "bp_id": -1}
HALF = 0.7071067811865476

PUBLISHED_POINTS = {
    0: [(0, 0, 0.5), (0, 0, -0.5), (-0.5, 0, 0), (0.5, 0, 0), (0, 0.5, 0), (0, -0.5, 0)],
    15: [(0, 0, 1), (-0.5, 0, 0.5), (0.5, 0, 0.5), (0, 0.5, 0.5), (0, -0.5, 0.5)],
    1: [
        *((0, 0, 2), (-0.5, 0, 0.5), (-0.5, 0, 1.5), (0.5, 0, 0.5), (0.5, 0, 1.5)),
        *((0, 0.5, 0.5), (0, 0.5, 1.5), (0, -0.5, 0.5), (0, -0.5, 1.5)),
    ],
    41: [
        *((0, 0, 2), (-0.5, 0, 0.5), (-0.5, 0, 1.5), (0.5, 0, 0.5), (0.5, 0, 1.5)),
        *((0, 0.5, 0.5), (0, 0.5, 1.5), (0, -0.5, 0.5), (0, -0.5, 1.5)),
    ],
    63: [
        *((0, 0, 3), (-0.5, 0, 0.5), (-0.5, 0, 1.5), (-0.5, 0, 2.5)),
        *((0.5, 0, 0.5), (0.5, 0, 1.5), (0.5, 0, 2.5), (0, 0.5, 0.5), (0, 0.5, 1.5)),
        *((0, 0.5, 2.5), (0, -0.5, 0.5), (0, -0.5, 1.5), (0, -0.5, 2.5)),
    ],
    2: [(0, 0, 0.5)],
    16: [(0, 0, 2), (-0.5, 0, 1.5), (0.5, 0, 1.5), (0, 0.5, 1.5), (0, -0.5, 1.5)],
    51: [(0, 0, 1), (-1, 0, 1), (1, 0, 1), (0, 1, 1), (0, -1, 1)],
    **dict.fromkeys(
        (5, 13, 18, 19, 22, 35, 44),
        ((0, 0, 1), (-0.5, 0, 0.5), (0.5, 0, 0.5), (0, 0.5, 0.5), (0, -0.5, 0.5)),
    ),
    **dict.fromkeys((27, 28, 39, 76), ((0, 0, 1),)),
    40: [(0, 0, 0.5)],
    **dict.fromkeys((3, 6, 11, 14, 17, 20, 23, 24, 29, 32, 36, 49, 50, 86, 87), ()),
    74: [(0, 0, 3), (-1.5, 0, 1.5), (1.5, 0, 1.5), (0, 1.5, 1.5), (0, -1.5, 1.5)],
}
"""Building points of BesiegeField's block table: right, up, ahead; of a piston (18) drawn in.

Left out are types whose points ours has elsewhere (46, 60) or another number of (4, 30).
"""

GAME_ROTATIONS = {
    "north": (1, 0, 0, 0),
    "south": (0, 0, 1, 0),
    "east": (HALF, 0, HALF, 0),
    "west": (HALF, 0, -HALF, 0),
    "up": (HALF, -HALF, 0, 0),
    "down": (HALF, HALF, 0, 0),
}
"""How BesiegeField turns a block that points some way: (w, x, y, z), the game's components."""
POINTS_OF_ROOT = {"north": 0, "south": 1, "west": 2, "east": 3, "up": 4, "down": 5}


def block(number: int, parent: int, point: int, kind: int | str = 15) -> dict[str, Any]:
    return {"id": kind, "order_id": number, "parent": parent, "bp_id": point}


def built(*entries: dict[str, Any]) -> Machine:
    machine = Machine(catalogue=module_set("all"))
    for _ in tree_actions(read_tree(json.dumps(entries)), machine):
        pass
    return machine


def refusal(*entries: Any) -> str:
    with pytest.raises(TreeError) as error:
        built(*entries)
    return str(error.value)


def module(number: int) -> Any:
    return next(known for known in module_set("all").values() if known.besiege_id == number)


@pytest.mark.parametrize("number", PUBLISHED_POINTS)
def test_building_points_are_numbered_as_in_besiegefields_table(number: int) -> None:
    kind = module(number)
    mirrored = kind.kind != "start"
    seen = []
    for face in points_of(kind):
        x, y, z = face.center
        seen.append((-x, y, z) if mirrored else (x, z, y))
    assert seen == [pytest.approx(point) for point in PUBLISHED_POINTS[number]]


@pytest.mark.parametrize("number", [46, 60])
def test_large_wheels_have_the_tables_order(number: int) -> None:
    sides = [point_text(module(number), place).split()[1] for place in range(9)]
    assert sides == ["front"] * 5 + ["left", "right", "up", "down"]


def test_each_module_has_a_point_for_every_face_but_the_one_it_sits_by() -> None:
    for kind in module_set("all").values():
        labels = [face.label for face in points_of(kind)]
        assert len(set(labels)) == len(labels)
        assert {*labels, kind.root_face} >= {face.label for face in kind.faces}


def test_a_point_in_words_says_side_and_place() -> None:
    assert point_text(module(63), 3) == "3 left [-0.5, 0, 2.5]"
    assert point_text(module(0), 4) == "4 up [0, 0.5, 0]"


@pytest.mark.parametrize("first", POINTS_OF_ROOT)
@pytest.mark.parametrize("point", range(5))
def test_blocks_are_turned_as_besiegefield_turns_them(first: str, point: int) -> None:
    """What they are on does not matter, only where they point."""
    machine = built(ROOT, block(1, 0, POINTS_OF_ROOT[first]), block(2, 1, point, "Hinge"))
    hinge = machine.blocks["3"]
    axis = tuple(round(value) for value in hinge.axis_xyz)
    pointing = {
        (0, 1, 0): "north",
        (0, -1, 0): "south",
        (1, 0, 0): "east",
        (-1, 0, 0): "west",
        (0, 0, 1): "up",
        (0, 0, -1): "down",
    }[axis]
    theirs = GAME_ROTATIONS[pointing]
    ours = besiege_rotation(hinge)
    assert abs(sum(a * b for a, b in zip(ours, theirs, strict=True))) == pytest.approx(1)


@pytest.mark.parametrize("pointing", POINTING)
def test_left_right_up_and_down_are_where_the_table_says(pointing: str) -> None:
    """Each hinge on a side of a block that points some way points where the table has that side."""
    directions = {
        "north": (0, 1, 0),
        "south": (0, -1, 0),
        "east": (1, 0, 0),
        "west": (-1, 0, 0),
        "up": (0, 0, 1),
        "down": (0, 0, -1),
    }
    for point, side in enumerate(POINTING[pointing], start=1):
        machine = built(ROOT, block(1, 0, POINTS_OF_ROOT[pointing]), block(2, 1, point))
        assert machine.blocks["3"].axis_xyz == pytest.approx(directions[side], abs=1e-9)


def test_wheels_that_point_west_are_flipped_so_that_both_sides_roll_north() -> None:
    machine = built(ROOT, block(1, 0, 2, 2), block(2, 0, 3, 2))
    assert machine.blocks["2"].flipped
    assert not machine.blocks["3"].flipped
    for wheel in ("2", "3"):
        text = machine.act("get_block_details", {"block_id": wheel}).text
        assert "forward rolls it <North>" in text


def test_both_spellings_and_names_of_modules_make_the_same_machine() -> None:
    released = built(ROOT, block(1, 0, 4), block(2, 1, 0, 2))
    paper = built(
        {"type": 0, "id": 0, "parent": None, "face_id": None},
        {"type": "small wooden block", "id": 1, "parent": 0, "face_id": 4},
        {"type": "2", "id": 2, "parent": 1, "face_id": 0},
    )
    assert released == paper


def test_connectors_join_two_faces_which_may_be_taken() -> None:
    machine = built(
        ROOT,
        block(1, 0, 0),
        block(2, 1, 3),
        {"id": 7, "order_id": 3, "parent_a": 0, "bp_id_a": 4, "parent_b": 2, "bp_id_b": 0},
        {"type": 45, "id": 9, "parent_a": 0, "face_id_a": 0, "parent_b": 2, "face_id_b": 1},
    )
    assert [link.module.name for link in machine.connectors.values()] == ["Brace", "Winch"]


def test_numbers_need_not_count_up() -> None:
    machine = built({**ROOT, "order_id": 7}, block(3, 7, 0), block(5, 3, 0))
    assert list(machine.blocks) == ["1", "2", "3"]


def test_a_tree_takes_the_place_of_what_was_built() -> None:
    machine = built(ROOT, block(1, 0, 0))
    tree = read_tree(json.dumps([ROOT, block(1, 0, 4)]))
    names = [action.name for action in tree_actions(tree, machine)]
    assert names == ["reset", "start", "attach_block_to"]
    assert machine.blocks["2"].mount == ("1", "C")


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ([], "expected a list of entries, found []"),
        ([ROOT, 5], "entry 1 (line 1): expected an object, found 5"),
        ([ROOT, ROOT], "entry 0 (id '0', line 1): order_id 0 is an earlier entry's as well"),
        (
            [ROOT, block(1, 0, 0), block(4, 9, 0, 22)],
            "entry 4 (id 22, line 1): parent 9 is not an earlier entry; earlier blocks: 0, 1",
        ),
        ([ROOT, block(1, 1, 0)], "parent 1 is not an earlier entry"),
        ([ROOT, block(1, 2, 0), block(2, 1, 0)], "parent 2 is not an earlier entry"),
        ([ROOT, block(1, -1, -1)], "parent -1 is not an earlier entry"),
        ([ROOT, block(1, 0, 0, True)], "there is no type True"),  # type: ignore[arg-type]
        ([ROOT, block(True, 0, 0)], "order_id: expected a whole number from 0"),
        ([ROOT, block(1, True, 0)], "parent: expected a whole number from -1"),
        ([ROOT, {**block(1, 0, 0), "order_id": "1"}], "order_id: expected a whole number"),
        ([ROOT, {**block(1, 0, 0), "parent": "0"}], "parent: expected a whole number"),
        ([ROOT, {**block(1, 0, 0), "bp_id": 0.5}], "bp_id: expected a whole number"),
        ([ROOT, block(10**9, 0, 0)], "order_id: expected a whole number from 0 to 1000000"),
        ([ROOT, block(1, 0, 0, 999)], "there is no type 999; id is a module or its number: 0, 1,"),
        ([ROOT, block(1, 0, 0, "Hing")], "there is no type 'Hing'; id is a module or its"),
        ([ROOT, block(1, 0, 6)], "has no point 6; its points: 0 front, 1 back, 2 left, 3 right"),
        ([ROOT, block(1, 0, 0, 2), block(2, 1, 1)], "Powered Wheel (entry 1) has no point 1"),
        ([ROOT, block(1, 0, 0, 47), block(2, 1, 0)], "nothing can be put on a Torch (entry 1)"),
        (
            [ROOT, block(1, 0, 0), block(2, 0, 0)],
            "point 0 of entry 0 is taken by entry 1; its free points: 1 back, 2 left",
        ),
        ([ROOT, block(1, 0, 0, 7)], "there is no field 'parent': a Brace joins two; fields: id,"),
        ([ROOT, {"id": 15, "order_id": 1, "parent": 0}], "bp_id is missing: a Small Wooden Block"),
        ([ROOT, {**block(1, 0, 0), "rotation": 90}], "there is no field 'rotation'"),
        ([block(0, -1, -1)], "a tree begins with its Starting Block (type 0)"),
        ([{**ROOT, "parent": 0}], "the Starting Block sits on nothing: parent is -1"),
        ([ROOT, block(1, 0, 0, 0)], "a tree has one starting block, its first entry"),
        ([ROOT] * (MAX_ENTRIES + 1), "expected at most 2,000 entries, found 2,001"),
    ],
)
def test_a_wrong_entry_is_named_with_what_it_may_be(entries: list[Any], message: str) -> None:
    assert message in refusal(*entries)


def test_blocks_that_overlap_are_refused_where_they_are_built() -> None:
    text = refusal(ROOT, block(1, 0, 0), block(2, 0, 4), block(3, 1, 3), block(4, 2, 4))
    assert text.startswith("entry 4 (id 15, line 1): ")
    assert "would overlap block 4" in text
    assert "Blocks are counted from 1" in text


def test_an_entry_is_named_with_its_line() -> None:
    text = json.dumps([ROOT, block(1, 0, 0), block(2, 5, 0)], indent=1)
    with pytest.raises(TreeError, match=r"entry 2 \(id 15, line 14\): parent 5"):
        read_tree(text)


@pytest.mark.parametrize(
    "text",
    [
        *("[" * 100_000, '[{"id":' * 1000, "[NaN]", "[1e999]", "[[[[]]]]", "{}", "null", '"[]"'),
        *("", "[" + "9" * 5000 + "]", '[{"id":' + "9" * 4000 + "}]", "[" + " " * (1 << 20) + "]"),
        '[{"id": "\\ud800", "order_id": 0}]',
    ],
)
def test_hostile_texts_are_refused_in_few_words(text: str) -> None:
    with pytest.raises(DocumentError) as error:
        read_tree(text)
    assert len(str(error.value)) < 1000


def test_the_tree_of_a_reply_is_its_last_list() -> None:
    fenced = "First\n```json\n[1]\n```\nno, rather\n```\n[2]\n```\nDone [really]."
    assert tree_in(fenced) == "[2]"
    assert tree_in("Here: [3, [4]] it is") == "[3, [4]]"
    with pytest.raises(TreeError, match="no construction tree"):
        tree_in("I can't.")


def test_action_logs_and_documents_are_no_trees() -> None:
    assert looks_like_tree([ROOT])
    assert not looks_like_tree([{"op": "start", "params": {}}])
    assert not looks_like_tree({"blocks": []})
    assert not looks_like_tree([])


SMALL = st.one_of(st.integers(-2, 7), st.booleans(), st.floats(), st.text(max_size=3), st.none())
ENTRY = st.dictionaries(
    st.sampled_from(["id", "type", "order_id", "parent", "bp_id", "face_id", "parent_a", "x"]),
    st.one_of(SMALL, st.lists(SMALL, max_size=2)),
)
SOUND = st.builds(
    block, st.integers(1, 30), st.integers(0, 5), st.integers(0, 5), st.sampled_from([15, 1, 2, 5])
)


@settings(max_examples=200, deadline=None)
@given(st.lists(st.one_of(ENTRY, SOUND), max_size=8))
def test_any_list_is_a_machine_or_refused(entries: list[Any]) -> None:
    machine = Machine(catalogue=module_set("all"))
    try:
        for _ in tree_actions(read_tree(json.dumps([ROOT, *entries])), machine):
            pass
    except TreeError:
        return
    assert machine.part_count == len(entries) + 1
    assert Machine.from_document(machine.to_document()) == machine
