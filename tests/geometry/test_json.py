"""JSON texts and values, read within bounds."""

import json
import math
import re
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import msgspec
import pytest

from buildarena_geometry.errors import DocumentError
from buildarena_geometry.json_texts import (
    MAX_DEPTH,
    TooDeepError,
    is_too_deep,
    read_json,
    write_json,
)
from buildarena_geometry.modules.solids import Ball, Box
from buildarena_geometry.rotations import ORIGIN
from buildarena_geometry.struct_reader import Amount, Finite, Form, Name, Point, Whole, read


def test_brackets_in_texts_are_no_depth(subtests) -> None:
    for text, deep in [
        ('"' + "[" * 1000 + '"', False),
        ('["' + '\\"' * 100 + "[" * 100 + '"]', False),
        (json.dumps([{"a": "]}" * 200}] * 200), False),
        ("[" * 64 + "]" * 64, False),
        ("[" * 65 + "]" * 65, True),
        ('{"\\\\":' * 65 + "1" + "}" * 65, True),
        ('[{"a":' * 32 + "1" + "}]" * 32, False),
        ('[{"a":' * 33 + "1" + "}]" * 33, True),
        ("[" + "[]," * 5000 + "[]]", False),
    ]:
        with subtests.test(text=text):
            assert is_too_deep(text.encode()) is deep


def test_a_deep_text_is_refused_before_the_stack_is_used_up(subtests) -> None:
    for bracket in ["[", '{"a":']:
        for depth in [MAX_DEPTH + 1, 990, 100_000]:
            with subtests.test(bracket=bracket, depth=depth):
                for text in (bracket * depth, (bracket * depth).encode()):
                    with pytest.raises(TooDeepError, match="more than 64 arrays or objects"):
                        read_json(text)


def test_a_value_is_written_within_its_depth() -> None:
    assert write_json({"a": [1, "é\ud800"]}, 2) == r'{"a":[1,"\u00e9\ud800"]}'
    deep: object = 1
    for _ in range(100_000):
        deep = [deep]
    for value in ({"a": [1]}, deep):
        with pytest.raises(TooDeepError, match="more than 1 arrays or objects"):
            write_json(value, 1)
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json({"a": math.nan})


def test_what_is_no_json_is_a_value_error(subtests) -> None:
    for text in ["", "{", b"\xff", '{"a"}', "[1,]"]:
        with subtests.test(text=text), pytest.raises(ValueError):
            read_json(text)


def test_a_misfit_is_told_by_its_place_and_by_what_may_stand_there(subtests) -> None:
    for form, value, told in [
        (list[Any], {}, "it: expected a list, found {}"),
        (list[Amount], [1, -1], "it[1]: expected a number of at least 0, found -1"),
        (Finite, True, "it: expected a number, found True"),
        (Point, [0, 0, math.inf], "it[2]: expected a finite number, found inf"),
        (Whole, 2.5, "it: expected a whole number, found 2.5"),
        (Whole, -1, "it: expected a whole number of at least 0, found -1"),
        (Name | None, 3, "it: expected a text or null, found 3"),
        (dict[str, tuple[str, ...]], {"keys": ["A", 4]}, "it.keys[1]: expected a text, found 4"),
        (dict[str, str], {4: "A"}, "it: expected an object whose keys are texts, found {4: 'A'}"),
        (Box | Ball, {"radius": 1}, "it: shape is missing"),
        (Box | Ball, {"shape": 1}, "it.shape: expected one of box, sphere, found 1"),
        (Box | Ball, {"shape": "sphere", "x": 1}, "unknown field 'x'; valid fields: shape, radius"),
        (Box, {"shape": "box", "from": ORIGIN, "to": ORIGIN}, "it.to: expected three numbers"),
    ]:
        refused = pytest.raises(DocumentError, match=re.escape(told))
        with subtests.test(form=form, value=value), refused:
            read(value, form, where="it", error=DocumentError)


def test_threads_may_be_the_first_to_read_a_form_together() -> None:
    count, fields, before = 8, 30, sys.getswitchinterval()
    inner = {f"n{i}": {"a": [1.0]} for i in range(fields)}
    value = {f"f{i}": [inner] for i in range(fields)}
    how: dict[str, Any] = {"bases": (Form,), "frozen": True, "kw_only": True}
    sys.setswitchinterval(1e-6)
    try:
        for _ in range(50):
            numbers = [(name, dict[str, tuple[float, ...]]) for name in inner]
            parts = msgspec.defstruct("Inner", numbers, **how)
            kind = msgspec.defstruct("Outer", [(name, list[parts]) for name in value], **how)  # type: ignore[valid-type]
            together = threading.Barrier(count)

            def first(kind: Any = kind, together: Any = together) -> object:
                together.wait()
                return read(value, kind, where="value", error=DocumentError)

            with ThreadPoolExecutor(count) as threads:
                found = [each.result() for each in [threads.submit(first) for _ in range(count)]]
            assert all(each == found[0] for each in found)
    finally:
        sys.setswitchinterval(before)
