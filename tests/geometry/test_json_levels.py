import pytest

from buildarena_geometry.json_values import levels

DEEP = {"a": 1, "b": {"c": (2, 3)}}


@pytest.mark.parametrize(
    ("value", "found"),
    [
        (1, [[1]]),
        ("text", [["text"]]),
        ([], [[[]]]),
        ({}, [[{}]]),
        ([1, [2, []]], [[[1, [2, []]]], [1, [2, []]], [2, []]]),
        (DEEP, [[DEEP], [1, {"c": (2, 3)}], [(2, 3)], [2, 3]]),
    ],
)
def test_each_level_has_what_the_one_above_holds(value, found) -> None:
    assert list(levels(value)) == found


def test_no_level_is_collected_before_it_is_asked_for() -> None:
    endless: list[object] = []
    endless.append(endless)
    for depth, level in enumerate(levels(endless)):
        assert level[0] is endless
        if depth == 100:
            break
