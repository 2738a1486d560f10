"""The task catalogue: versions, what statements say, and errors in a user's own, line by line."""

import json
import time

import pytest
import yaml
from pydantic import BaseModel, ConfigDict

from buildarena_benchmark import SourceError, TaskError, load_task, paper_tasks
from buildarena_benchmark.tasks.sources import MAX_BYTES, parse_model, parse_source, path_of

OWN = """\
name: tower-bridge
title: A suspended bridge
category: support
statement: |
  Hang a deck by ropes over a gap of 10.
constraints:
  max_sub_structures: 5
  max_blocks: 100
scenario:
  duration_s: 10
  terrain:
    - {center: [0, -15, 2.5], size: [30, 20, 5]}
    - {center: [0, 15, 2.5], size: [30, 20, 5]}
  cargo: {size: [2.5, 2.5, 1.5], final_mass: 300, ramp_s: 8}
  placement: {kind: span, gap: 10}
scoring:
  name: support
  min_time_s: 3
indicator: {name: load, unit: mass units}
"""
VERSIONS = {
    "transport-1": "b2ccb3dea7af",
    "transport-2": "5435fd00bb00",
    "transport-3": "1916de99c4d3",
    "support-1": "56cb843d8bb3",
    "support-2": "f27a3d9c23e7",
    "support-3": "eed7f2d8d74a",
    "lift-1": "1b4cd692f654",
    "lift-2": "f90a58d2f205",
    "lift-3": "89d6c1e4abc7",
    "mechanisms-1": "66a6c21e2343",
    "flight-2": "fa47fae88701",
}
"""They change with the rules alone (`SCORER_VERSION`), and with what statements say of them."""


def test_the_first_tasks_are_what_they_were(tasks) -> None:
    """Their results stay comparable: whatever is added, their versions stay."""
    assert {name: tasks[name].version for name in VERSIONS} == VERSIONS
    assert list(paper_tasks()) == list(VERSIONS)[:9]
    assert len({task.version for task in tasks.values()}) == len(tasks)


def test_tasks_are_read_as_anybodys_are_and_their_document_is_the_task_again(tasks) -> None:
    own = load_task(OWN)
    assert (own.name, own.scorer, own.control) == ("tower-bridge", "support", "none")
    for task in (*tasks.values(), own):
        assert load_task(yaml.safe_dump(dict(task.as_document()))) == task


FOR_THROWS = {"max_error": "deviates by at most 3 %", "max_unexplained": "at most 5 % more energy"}


def test_a_statement_tells_what_is_measured_and_every_threshold(tasks, subtests) -> None:
    for name, task in tasks.items():
        with subtests.test(name=name):
            text, scenario = " ".join(task.statement.split()), task.scenario
            for heading in ("**Goal.**", "**Rules.**", "**Trial.**", "**Measure.**"):
                assert heading in text
            assert f"{scenario.duration_s:g} seconds" in text
            if scenario.cargo is not None and task.category in {"transport", "support", "lift"}:
                assert " x ".join(f"{v:g}" for v in scenario.cargo.size) in text
                assert f"{scenario.cargo.final_mass:g}" in text
            if scenario.control.until_s is not None:
                assert f"At {scenario.control.until_s:g} s all keys are let go" in text
            if name in paper_tasks() or task.category in {"control", "space"}:
                continue
            for field, value in task.scoring.model_dump().items():
                if isinstance(value, int | float) and not isinstance(value, bool):
                    thrown = FOR_THROWS.get(field) if task.scoring.name == "throw" else None
                    number = thrown or f"{value:g}"
                    assert number in text, field
            for place in (*scenario.gates, *scenario.marks):
                planar = task.scoring.name == "tour"  # heights of its marks mean nothing
                place_of = place.center[:2] if planar else place.center
                assert f"({', '.join(f'{c:g}' for c in place_of)})" in text


def test_what_can_change_a_score_changes_the_version(tmp_path) -> None:
    file = tmp_path / "own.yaml"
    file.write_text(OWN, encoding="utf-8")
    assert load_task(file) == load_task(str(file)) == load_task(OWN)
    version = load_task(OWN).version
    for old, new in (
        ("final_mass: 300", "final_mass: 301"),
        ("min_time_s: 3", "min_time_s: 2"),
        ("over a gap of 10", "over a gap of ten"),
        ("max_blocks: 100", "max_blocks: 99"),
        ("duration_s: 10", "duration_s: 11"),
    ):
        assert load_task(OWN.replace(old, new)).version != version, old
    renamed = OWN.replace("A suspended bridge", "Another title").replace("tower-bridge", "other")
    reordered = yaml.safe_dump(yaml.safe_load(OWN), sort_keys=True)
    assert load_task(renamed).version == load_task(reordered).version == version


BLOCKS, SUPPORT = "max_blocks: 100", "name: support\n  min_time_s: 3"
"""Lines of that task which others take the place of."""
BOX = "    - {center: [0, 0, 0], size: [1, 1, 1]}\n"


def test_an_error_names_line_field_and_choices(subtests) -> None:
    for old, new, *says in (
        ("min_time_s: 3", "min_tim_s: 3", "task:18: scoring.min_tim_s: unknown", "min_time_s"),
        ("name: support\n", "name: suport\n", "scoring", "'thrust', 'tour', 'transport'"),
        ("gap: 10}", "gap: -1}", "task:15: scenario.placement.gap: ", "greater than 0"),
        ("kind: span", "kind: hover", "placement", "'ground', 'span'"),
        ("duration_s: 10", "duration_s: 10.01", "duration_s", "0.04"),
        ("title: A suspended bridge\n", "", "title", "required"),
        (BLOCKS, "max_blocks: many", "task:8: constraints.max_blocks: ", "integer"),
        ("indicator: {", "indicator: [", "not valid YAML"),
        # Out of bounds
        ("duration_s: 10", "duration_s: 601", "less than or equal to 600"),
        ("duration_s: 10", "duration_s: 100", "50,000 block-seconds; at most 20,000"),
        (BLOCKS, "max_blocks: 401", "20,050 block-seconds"),
        (BLOCKS, "max_blocks: 1001", "constraints.max_blocks"),
        ("max_sub_structures: 5", "max_sub_structures: 21", "constraints.max_sub_structures"),
        ("final_mass: 300", "final_mass: 1e6", "scenario.cargo.final_mass"),
        ("final_mass: 300", "final_mass: .nan", "scenario.cargo.final_mass"),
        ("ramp_s: 8", "ramp_s: 8, ramp_start_s: .inf", "scenario.cargo.ramp_start_s"),
        ("size: [2.5, 2.5, 1.5]", "size: [1e300, 1, 1]", "scenario.cargo.size[0]"),
        ("size: [30, 20, 5]", "size: [1e9, 20, 5]", "scenario.terrain[0].size[0]"),
        ("gap: 10}", "gap: 1e9}", "scenario.placement.gap"),
        ("min_time_s: 3", "min_time_s: .inf", "scoring.min_time_s"),
        ("indicator: {name: load", 'indicator: {name: "$x$"', "indicator.name"),
        ("title: A suspended bridge", 'title: "\\e[31m"', "title: "),
        ("  terrain:\n", "  terrain:\n" + 63 * BOX, "task:11: scenario.terrain: ", "at most 64"),
        # What no machine can pass
        (BLOCKS, "min_sub_structures: 6", "constraints.max_sub_structures: is 5"),
        (BLOCKS, "modules: [Winch, Roket]", "8: constraints.modules[1]: unknown"),
        (BLOCKS, "modules: [Rocket]", "'Rocket' can be built, but is not simulated"),
        (BLOCKS, "modules: garage", "unknown module set 'garage'; choose from basic, work"),
        (BLOCKS, "modules: all", "'all' has modules that are not simulated; choose"),
        (BLOCKS, "min_modules: {Hinge: 1}", "Hinge is not among the task's modules"),
        (BLOCKS, "min_modules: {Rope: 2}", "min_modules.Rope: unknown module"),
        ("  cargo: {", "  # cargo: {", "scoring: the cargo is judged, but scenario has no cargo"),
        ("  min_time_s: 3", "  min_time_s: 11", "longer than the trial"),
        (SUPPORT, "name: transport\n  subject: cargo", "scenario.control.mode must be agent"),
        (SUPPORT, "name: height", "nothing fires"),
        (
            f"placement: {{kind: span, gap: 10}}\nscoring:\n  {SUPPORT}",
            "control: {mode: constant}\nscoring:\n  name: height",
            "windows within the trial",
        ),
    ):
        with subtests.test(new=new[:60]):
            assert old in OWN
            with pytest.raises(TaskError) as caught:
                load_task(OWN.replace(old, new, 1))
            assert [part for part in says if part not in str(caught.value)] == []
    with pytest.raises(TaskError, match=r"nowhere\.yaml"):
        load_task("nowhere.yaml")


SWING = {"swing": [1, 1, 1], "period_s": [9] * 3}
MOVING = [{"name": "goal", "center": [0, 0, 0], "radius": 1, "drift": SWING}]
BALL_BEYOND = [{"name": "line", "center": [0, 5], "half_width": 6}]


def test_what_no_machine_can_do_is_refused(tasks, subtests) -> None:
    released = {"placement": {"kind": "released", "height": 5}, "randomization": {}}
    no_mark = {"marks": [], "randomization": {}}
    for name, changes, message in (
        ("throw-1", {"gates": []}, "unknown gate 'line'; gates: none"),
        ("throw-1", released, "is not ground"),
        ("throw-1", {"gusts": {"strength": 2}}, "would throw as well"),
        ("throw-1", {"tracked_blocks": ["1"]}, "only if all blocks are tracked"),
        ("throw-1", {"scoring": {"rings": ["hoop"]}}, "unknown mark 'hoop'"),
        ("throw-1", {"scoring": {"borne_s": 20}}, "borne_s 20 is longer"),
        ("deliver-2", {"gates": []}, "unknown gate 'line'; gates: none"),
        ("deliver-2", {"cargo": None}, "needs shape: ball"),
        ("deliver-2", {"gates": BALL_BEYOND}, "already"),
        ("deliver-2", {"pushes": [{"at_s": 1, "velocity": [0, 5]}]}, "would deliver as well"),
        ("deliver-2", {"tracked_blocks": ["1"]}, "only if all blocks are tracked"),
        ("place-2", {"cargo": None, "randomization": {}}, "has none: give cargo.at"),
        ("place-2", no_mark, "unknown mark 'goal'"),
        ("place-2", {"duration_s": 2, "randomization": {}}, "rest_s 2 is longer"),
        ("balance-2", released, "not alone on flat"),
        ("balance-2", {"terrain": [{"center": [0, 9, 1], "size": [2, 2, 2]}]}, "not alone on flat"),
        ("balance-2", {"duration_s": 15}, "min_s 20 is longer"),
        ("walk-1", released, "not put on the ground"),
        ("line-1", {"line": None, "randomization": {}}, "scenario.line is missing"),
        (
            "line-1",
            {"line": {"radius": 12, "bends": [[0.4, 0.2]]}, "randomization": {}},
            "are 0.6 in all",
        ),
        ("line-1", {"randomization": {"line.bends.3": [[0, 0], [0.1, 0.1]]}}, "there is no '3'"),
        *(
            ("line-1", {"scoring": {which: 13}}, "stretches")
            for which in ("min_stretches", "all_stretches")
        ),
        (
            "landing-2",
            {"placement": {"kind": "ground"}, "randomization": {}},
            "kind is not released",
        ),
        ("landing-2", no_mark, "unknown mark 'goal'"),
        ("landing-2", {"duration_s": 2}, "hold_s 3 is longer"),
        ("hover-4", no_mark, "unknown mark 'goal'"),
        ("hover-4", {"duration_s": 4}, "from_s 5 is not within"),
        ("slalom-2", {"gates": [], "randomization": {}}, "has 0"),
        ("slalom-2", {"randomization": {"gates.gate 9.center": [[0, 0], [1, 1]]}}, "no 'gate 9'"),
        ("landing-2", {"marks": MOVING}, r"moves \(drift\), and this scorer's marks stay"),
        (
            "place-2",
            {"marks": MOVING, "randomization": {}},
            r"moves \(drift\), and this scorer's marks stay",
        ),
        *(
            (name, {"control": {"mode": "none"}}, "control")
            for name in ("throw-1", "deliver-2", "balance-2", "walk-1", "line-1", "landing-2")
        ),
    ):
        with subtests.test(name=name, message=message):
            document = dict(tasks[name].as_document()) | {"name": "other", "statement": "s"}
            part = "scoring" if "scoring" in changes else "scenario"
            document[part] = {**document[part], **changes.get("scoring", changes)}
            text = json.dumps({key: value for key, value in document.items() if value is not None})
            with pytest.raises(TaskError, match=message):
                load_task(text + "\n")


# Untrusted YAML texts: nothing in them makes reading costly, and every fault has its line

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
    start = time.process_time()
    for text, *says in (
        (BOMB, "file:1: anchors and aliases are not allowed"),
        ("a: 1\nb: *x\n", "file:2: anchors and aliases are not allowed"),
        ("a:\n  <<: {b: 1}\n", "file:2: merge keys are not allowed"),
        ("[" * 60_000, "file:1: nested more than 16 levels"),
        ("- " * 30_000 + "x", "file:1: nested more than 16 levels"),
        ("a: 1\nb: 2\na: 3\n", "file:3: a: appears twice, first in line 1"),
        ("a:\n  - {b: 1}\n  - {b: 1, b: 2}\n", "file:3: a[1].b: appears twice"),
        ("a: 1\nb: \0\n", "file:2: not valid YAML: special characters"),
        ("a: 1\nb: !!python/object/apply:os.getcwd []\n", "file:2: not valid YAML"),
        ("a: 1\nb: " + "9" * 20_000, "file:2: the value cannot be read"),
        ("a: " + "x" * MAX_BYTES, "file: 65,539 bytes; at most 65,536 are read"),
        ("", "file: must be a mapping of fields"),
        ("items: []\n", "file:1: name: Field required"),
        ("name: a\n\nitms: 1\n", "file:3: itms: unknown field; choose from name, items"),
        ("name: a\nitems:\n  - {}\n  - dept: 1\n", "file:4: items[1].dept: ", "from depth"),
        ("name: a\nitems:\n  - 7\n", "file:3: items[0]: must be a mapping of fields"),
        ("name: [1]\nitems: 2\n", "file:1: name: ", "file:2: items: "),
    ):
        with subtests.test(text=text[:60]):
            with pytest.raises(SourceError) as caught:
                parse_model(text, Outer, origin="file")
            assert [part for part in says if part not in str(caught.value)] == []
    # No bar of speed: a bomb that went off would take hours.
    assert time.process_time() - start < 20
    source = parse_source("name: a\nitems:\n  - depth: 1\n  -\n    depth: 2\n", origin="file")
    for field, line in (("items[1].depth", 5), ("items[7].depth", 2), ("nowhere", 1)):
        assert source.line_of(path_of(field)) == line
