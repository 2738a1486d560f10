"""YAML texts of strangers: nothing in them makes reading costly, and every fault has its line."""

import time

import pytest
from pydantic import BaseModel, ConfigDict

from buildarena_benchmark import SourceError
from buildarena_benchmark.tasks.sources import MAX_BYTES, path_of, read_model, read_source

BOMB = "a0: &a0 [x, x]\n" + "".join(
    f"a{n}: &a{n} [*a{n - 1}, *a{n - 1}, *a{n - 1}, *a{n - 1}]\n" for n in range(1, 30)
)


class Inner(BaseModel):
    model_config = ConfigDict(extra="forbid")

    depth: int = 1


class Outer(BaseModel):
    model_config = ConfigDict(extra="forbid")

    name: str
    items: list[Inner] = []
    only: Inner | None = None


def test_what_is_not_read_is_reported_with_its_line(subtests) -> None:
    for text, says in [
        (BOMB, "file:1: anchors and aliases are not allowed"),
        ("a: &x 1\n", "file:1: anchors and aliases are not allowed"),
        ("a: 1\nb: *x\n", "file:2: anchors and aliases are not allowed"),
        ("a:\n  <<: {b: 1}\n", "file:2: merge keys are not allowed"),
        ("[" * 60_000, "file:1: nested more than 16 levels"),
        ("- " * 30_000 + "x", "file:1: nested more than 16 levels"),
        ("a: 1\nb: 2\na: 3\n", "file:3: a: appears twice, first in line 1"),
        ("a:\n  - {b: 1}\n  - {b: 1, b: 2}\n", "file:3: a[1].b: appears twice"),
        ("a: 1\n2: 3\n", "file:2: the key 2 is not text"),
        ("a: 1\n? [b]\n: c\n", "file:2: not valid YAML"),
        ("a: [\n", "file:2: not valid YAML"),
        ("a: 1\n---\nb: 1\n", "file:2: not valid YAML"),
        ("a: 1\nb: \0\n", "file:2: not valid YAML: special characters"),
        ("a: 1\nb: !!python/object/apply:os.getcwd []\n", "file:2: not valid YAML"),
        ("a: 1\nb: " + "9" * 20_000, "file:2: the value cannot be read"),
        ("a: 2020-13-01\n", "file:1: the value cannot be read"),
        ("a: " + "x" * MAX_BYTES, "file: 65,539 bytes; at most 65,536 are read"),
    ]:
        with subtests.test(text=text):
            start = time.process_time()
            with pytest.raises(SourceError) as caught:
                read_source(text, origin="file")
            assert says in str(caught.value)
            # No bar of speed: a bomb that went off would take hours.
            assert time.process_time() - start < 20


def test_what_a_model_does_not_take_is_reported_with_its_line(subtests) -> None:
    for text, says in [
        ("", ["file: must be a mapping of fields"]),
        ("- 1", ["file:1: must be a mapping of fields"]),
        ("items: []\n", ["file:1: name: Field required"]),
        ("name: a\n\nitms: 1\n", ["file:3: itms: there is no such field; choose from name, items"]),
        (
            "name: a\nitems:\n  - depth: 1\n  - dept: 1\n",
            ["file:4: items[1].dept: there is no such field; choose from depth"],
        ),
        ("name: a\nonly:\n  x: 1\n", ["file:3: only.x: there is no such field; choose from depth"]),
        ("name: a\nonly:\n  depth: y\n", ["file:3: only.depth: ", "valid integer"]),
        ("name: a\nitems:\n  - 7\n", ["file:3: items[0]: must be a mapping of fields"]),
        ("name: [1]\nitems: 2\n", ["file:1: name: ", "file:2: items: "]),
    ]:
        with subtests.test(text=text):
            with pytest.raises(SourceError) as caught:
                read_model(text, Outer, origin="file")
            for part in says:
                assert part in str(caught.value)


def test_a_fields_spelling_leads_back_to_its_line() -> None:
    source = read_source("name: a\nitems:\n  - depth: 1\n  -\n    depth: 2\n", origin="file")
    assert path_of("items[1].depth") == ["items", 1, "depth"]
    assert source.line_of(path_of("items[1].depth")) == 5
    assert source.line_of(path_of("items[7].depth")) == 2
    assert source.line_of(path_of("nowhere")) == 1
