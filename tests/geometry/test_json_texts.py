import json

import pytest

from buildarena_geometry.json_texts import MAX_DEPTH, TooDeepError, is_too_deep, read_json


@pytest.mark.parametrize(
    ("text", "deep"),
    [
        ('"' + "[" * 1000 + '"', False),
        ('["' + '\\"' * 100 + "[" * 100 + '"]', False),
        (json.dumps([{"a": "]}" * 200}] * 200), False),
        ("[" * 64 + "]" * 64, False),
        ("[" * 65 + "]" * 65, True),
        ('{"\\\\":' * 65 + "1" + "}" * 65, True),
        ("[" + "[]," * 5000 + "[]]", False),
    ],
)
def test_brackets_in_texts_are_no_depth(text, deep) -> None:
    assert is_too_deep(text.encode()) is deep


@pytest.mark.parametrize("bracket", ["[", '{"a":'])
@pytest.mark.parametrize("depth", [MAX_DEPTH + 1, 990, 100_000])
def test_a_deep_text_is_refused_before_the_stack_is_used_up(bracket, depth) -> None:
    for text in (bracket * depth, (bracket * depth).encode()):
        with pytest.raises(TooDeepError, match="more than 64 arrays or objects"):
            read_json(text)


@pytest.mark.parametrize("value", [1, 'ü\\"[', [], {"a": [{"b": None}]}, "\ud800"])
def test_everything_else_is_read_as_it_was_written(value) -> None:
    assert read_json(json.dumps(value)) == value
    assert read_json(json.dumps(value).encode()) == value


@pytest.mark.parametrize("text", ["", "{", b"\xff", '{"a"}', "[1,]"])
def test_what_is_no_json_is_a_value_error(text) -> None:
    with pytest.raises(ValueError):
        read_json(text)
