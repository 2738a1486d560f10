"""What the JSON columns of an archive's rows may hold."""

import math
from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from buildarena_store.archives.rows import DEEPEST, LARGEST_COUNT, Json

READ = TypeAdapter(Json).validate_python


def lists(levels: int, inner: Any) -> Any:
    for _ in range(levels):
        inner = [inner]
    return inner


@pytest.mark.parametrize(
    "value",
    [
        None,
        "text",
        [1.5, True, {"a": [None]}],
        LARGEST_COUNT,
        -LARGEST_COUNT,
        lists(DEEPEST, 1),
        lists(DEEPEST, {}),
        {"a": lists(DEEPEST - 1, "x")},
    ],
)
def test_plain_values_come_in_as_they_are(value) -> None:
    assert READ(value) == value


@pytest.mark.parametrize("wrap", [lambda v: v, lambda v: [0, v], lambda v: {"a": {"b": [v]}}])
@pytest.mark.parametrize(
    ("value", "message"),
    [
        (math.nan, "nan is not a finite number"),
        (-math.inf, "-inf is not a finite number"),
        (LARGEST_COUNT + 1, "beyond 2"),
        (-LARGEST_COUNT - 1, "beyond 2"),
        ("a\0b", "NUL"),
        ({"a\0b": 1}, "NUL"),
        (lists(DEEPEST + 1, 1), "nested deeper than 64"),
        (lists(DEEPEST + 1, []), "nested deeper than 64"),
        ({"a": lists(DEEPEST, "x")}, "nested deeper than 64"),
    ],
)
def test_others_are_refused_wherever_they_stand(wrap, value, message) -> None:
    with pytest.raises(ValidationError, match=message):
        READ(wrap(value))
