"""The task catalogue: its tasks, their versions, and errors in a user's own."""

import re
from importlib import resources

import pytest
import yaml

from buildarena_benchmark import TaskError, load_task, paper_tasks

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


DIMENSIONS = {
    *("quantification", "robustness", "magnitude", "compositionality", "precision", "ambiguity")
}
WORKSHOP = [*(f"mechanisms-{level}" for level in (1, 2, 3, 4)), "flight-1", "flight-2"]
HEADROOM = [
    *("support-4", "support-5", "mechanisms-5", "mechanisms-6", "transport-4"),
    *("flight-3", "lift-4", "mechanisms-7", "support-6", "support-7"),
]
FAMILIES = ["budget-1", "repair-1", "identify-1"]
CONTROL = [
    *("landing-1", "landing-2", "slalom-2", "hover-3", "hover-4"),
    *("balance-1", "balance-2", "walk-1", "walk-2", "place-2", "line-1"),
]


THROWING = ["throw-1", "throw-2", "throw-3", "throw-4", "throw-5"]
COURSES = [
    *(f"deliver-{level}" for level in (1, 2, 3)),
    *(f"drive-{level}" for level in (1, 2, 3, 4)),
    "fetch-1",
]
SPACE = ["orbit-1", "orbit-2"]
GROUPS = {
    "headroom": HEADROOM,
    "families": FAMILIES,
    "control": CONTROL,
    "throwing": THROWING,
    "space": SPACE,
    "courses": COURSES,
}


def test_there_are_the_papers_tasks_and_those_of_other_categories(tasks) -> None:
    paper = [f"{c}-{n}" for c in ("transport", "support", "lift") for n in (1, 2, 3)]
    further = [*HEADROOM, *FAMILIES, *CONTROL, *THROWING, *SPACE, *COURSES]
    assert list(tasks) == [*paper, *WORKSHOP, *further]
    assert list(paper_tasks()) == paper
    for name, task in tasks.items():
        kind, _, level = name.rpartition("-")
        category = next((group for group, names in GROUPS.items() if name in names), kind)
        assert (task.category, task.level) == (category, int(level))
        assert set(task.difficulty) == DIMENSIONS
        assert all(1 <= weight <= 3 for weight in task.difficulty.values())


def test_built_in_tasks_are_read_as_anybodys_are(tasks) -> None:
    for name, task in tasks.items():
        text = resources.files("buildarena_benchmark.tasks") / "catalogue" / f"{name}.yaml"
        assert load_task(text.read_text(encoding="utf-8")) == task


def test_each_task_has_the_papers_scenario() -> None:
    tasks = paper_tasks()
    durations = [task.scenario.duration_s for task in tasks.values()]
    assert durations == [30, 30, 30, 17, 17, 17, 10, 30, 30]
    assert [task.control for task in tasks.values()] == ["agent"] * 3 + ["none"] * 3 + ["held"] * 3
    for level, gap in ((1, 5), (2, 10), (3, 20)):
        south, north = tasks[f"support-{level}"].scenario.terrain
        assert north.center[1] - north.size[1] / 2 == gap / 2
        assert south.center[1] + south.size[1] / 2 == -gap / 2
        assert north.center[2] + north.size[2] / 2 == 5
    subs = [task.constraints.max_sub_structures for task in tasks.values()]
    assert subs == [1, 1, 1, 1, 3, 3, 1, 1, 2]
    assert tasks["lift-3"].constraints.min_sub_structures == 2
    assert tasks["transport-3"].scenario.cargo is not None
    assert tasks["transport-3"].scenario.cargo.size == (4, 8, 1.5)


def test_a_statement_tells_what_the_scorer_measures(tasks) -> None:
    for task in tasks.values():
        text = task.statement
        for heading in ("**Goal.**", "**Rules.**", "**Trial.**", "**Measure.**"):
            assert heading in text, task.name
        scenario = task.scenario
        assert f"{scenario.duration_s:g} seconds" in " ".join(text.split()), task.name
        if scenario.cargo is not None:
            assert " x ".join(f"{v:g}" for v in scenario.cargo.size) in text
            assert f"{scenario.cargo.final_mass:g}" in text
        if task.scoring.name == "height":
            assert f"{task.scoring.min_height:g}" in text
        if task.scoring.name == "support":
            assert f"z = {task.scoring.fall_height:g}" in text
        if task.constraints.min_wheels:
            assert "four powered wheels" in text


@pytest.mark.parametrize("name", [*WORKSHOP, *HEADROOM, *FAMILIES, *THROWING, *COURSES])
def test_a_statement_tells_every_threshold(tasks, name) -> None:
    task = tasks[name]
    text = " ".join(task.statement.split())
    for field, value in task.scoring.model_dump().items():
        if isinstance(value, int | float) and not isinstance(value, bool):
            assert TOLD.get((name, field), f"{value:g}") in text, (name, field)
    for place in (*task.scenario.gates, *task.scenario.marks):
        planar = task.scoring.name == "tour"  # heights of its marks mean nothing
        place_of = place.center[:2] if planar else place.center
        assert f"({', '.join(f'{c:g}' for c in place_of)})" in text
    if task.scenario.control.until_s is not None:
        assert f"At {task.scenario.control.until_s:g} s all keys are let go" in text
    assert task.version not in {paper.version for paper in paper_tasks().values()}


TOLD = {
    ("mechanisms-2", "min_gates"): "at least four gates",
    ("mechanisms-5", "min_gates"): "at least seven gates",
    ("flight-1", "height"): "between z = 8.5 and z = 11.5",
    ("flight-1", "band"): "between z = 8.5 and z = 11.5",
    **{(name, "max_error"): "strays by at most 3 %" for name in THROWING},
    **{(name, "max_unexplained"): "at most 5 % more energy" for name in THROWING},
}


def test_the_papers_tasks_are_what_they_were() -> None:
    """Their results stay comparable: whatever is added, their versions stay.

    They change with the rules alone (`SCORER_VERSION`), and with what statements say of them.
    """
    assert {name: task.version for name, task in paper_tasks().items()} == {
        "transport-1": "1a6e4c9aace2",
        "transport-2": "2f8eac5e5cbc",
        "transport-3": "ac485b82739a",
        "support-1": "dc2a9e577c96",
        "support-2": "49ca415d7fa0",
        "support-3": "024c9cf37d58",
        "lift-1": "b4c0ca1433d4",
        "lift-2": "65a071aa4121",
        "lift-3": "c0ad99acb8b0",
    }


def test_the_workshops_tasks_are_what_they_were(tasks) -> None:
    assert {name: tasks[name].version for name in WORKSHOP} == {
        "mechanisms-1": "00dcdd3aeed7",
        "mechanisms-2": "19f65b3f6da0",
        "mechanisms-3": "f6013c1e73b3",
        "mechanisms-4": "1dd52cf611c6",
        "flight-1": "41db632e0d4e",
        "flight-2": "bbd7fca7436a",
    }


def test_a_users_own_task_loads_from_text_and_file(tmp_path) -> None:
    task = load_task(OWN)
    assert (task.name, task.scorer, task.control) == ("tower-bridge", "support", "none")
    file = tmp_path / "own.yaml"
    file.write_text(OWN, encoding="utf-8")
    assert load_task(file) == task == load_task(str(file))


def test_what_can_change_a_score_changes_the_version(subtests) -> None:
    for old, new in [
        ("final_mass: 300", "final_mass: 301"),
        ("min_time_s: 3", "min_time_s: 2"),
        ("over a gap of 10", "over a gap of ten"),
        ("max_blocks: 100", "max_blocks: 99"),
        ("duration_s: 10", "duration_s: 11"),
    ]:
        with subtests.test(old=old):
            assert load_task(OWN.replace(old, new)).version != load_task(OWN).version


def test_what_cannot_change_a_score_keeps_the_version() -> None:
    renamed = OWN.replace("A suspended bridge", "Another title").replace("tower-bridge", "other")
    assert load_task(renamed).version == load_task(OWN).version
    reordered = yaml.safe_dump(yaml.safe_load(OWN), sort_keys=True)
    assert load_task(reordered).version == load_task(OWN).version


def test_an_error_names_line_field_and_choices(subtests) -> None:
    for old, new, parts in [
        (
            "min_time_s: 3",
            "min_tim_s: 3",
            ["task:18: scoring.min_tim_s: there is", "min_time_s"],
        ),
        ("name: support\n", "name: suport\n", ["scoring", "'thrust', 'tour', 'transport'"]),
        ("gap: 10}", "gap: -1}", ["task:15: scenario.placement.gap: ", "greater than 0"]),
        ("kind: span", "kind: hover", ["placement", "'ground', 'span'"]),
        ("duration_s: 10", "duration_s: 10.01", ["duration_s", "0.04"]),
        ("title: A suspended bridge\n", "", ["title", "required"]),
        ("max_blocks: 100", "max_blocks: many", ["task:8: constraints.max_blocks: ", "integer"]),
        ("indicator: {", "indicator: [", ["not valid YAML"]),
    ]:
        with subtests.test(old=old):
            assert old in OWN
            with pytest.raises(TaskError) as caught:
                load_task(OWN.replace(old, new))
            for part in parts:
                assert part in str(caught.value)


def test_a_trial_that_is_out_of_bounds_is_refused(subtests) -> None:
    for old, new, says in [
        ("duration_s: 10", "duration_s: 601", "less than or equal to 600"),
        ("duration_s: 10", "duration_s: 100", "50,000 block-seconds; at most 20,000"),
        ("max_blocks: 100", "max_blocks: 401", "20,050 block-seconds"),
        ("max_blocks: 100", "max_blocks: 1001", "constraints.max_blocks"),
        ("max_sub_structures: 5", "max_sub_structures: 21", "constraints.max_sub_structures"),
        ("final_mass: 300", "final_mass: 1e6", "scenario.cargo.final_mass"),
        ("final_mass: 300", "final_mass: .nan", "scenario.cargo.final_mass"),
        ("final_mass: 300", "final_mass: .inf", "scenario.cargo.final_mass"),
        ("final_mass: 300", f"final_mass: {'9' * 4000}", "scenario.cargo.final_mass"),
        ("ramp_s: 8", "ramp_s: 8, ramp_start_s: .inf", "scenario.cargo.ramp_start_s"),
        ("size: [2.5, 2.5, 1.5]", "size: [1e300, 1, 1]", "scenario.cargo.size[0]"),
        ("size: [2.5, 2.5, 1.5]", "size: [1e-9, 1, 1]", "scenario.cargo.size[0]"),
        ("size: [30, 20, 5]", "size: [1e9, 20, 5]", "scenario.terrain[0].size[0]"),
        ("gap: 10}", "gap: 1e9}", "scenario.placement.gap"),
        ("min_time_s: 3", "min_time_s: .inf", "scoring.min_time_s"),
        ("indicator: {name: load", 'indicator: {name: "$x$"', "indicator.name"),
        ("title: A suspended", 'title: "\\e[31m', "title: "),
        ("title: A suspended bridge", 'title: "\\ud800"', "title: "),
    ]:
        with subtests.test(old=old):
            assert old in OWN
            text = OWN.replace(old, new, 1)
            if new.startswith('title: "\\e'):
                text = text.replace("31m bridge", '31m bridge"')
            with pytest.raises(TaskError, match=re.escape(says)):
                load_task(text)


BLOCKS, SUPPORT = "max_blocks: 100", "name: support\n  min_time_s: 3"
"""Lines of that task which others take the place of."""


def test_more_terrain_than_is_simulated_is_refused() -> None:
    box = "    - {center: [0, 0, 0], size: [1, 1, 1]}\n"
    with pytest.raises(TaskError, match=r"task:11: scenario\.terrain: .*at most 64"):
        load_task(OWN.replace("  terrain:\n", "  terrain:\n" + 63 * box))


def test_a_task_that_nobody_can_pass_is_refused(subtests) -> None:
    for old, new, says in [
        (BLOCKS, "min_sub_structures: 6", "constraints.max_sub_structures: is 5"),
        (BLOCKS, "modules: [Winch, Roket]", "8: constraints.modules[1]: there is no"),
        (BLOCKS, "modules: [Rocket]", "'Rocket' can be built, but is not simulated"),
        (BLOCKS, "modules: garage", "no module set 'garage'; choose from basic, work"),
        (BLOCKS, "modules: all", "'all' has modules that are not simulated; choose"),
        (BLOCKS, "modules: 5", "constraints.modules: Input should be a valid tuple"),
        (BLOCKS, "min_modules: {Hinge: 1}", "Hinge is not among the task's modules"),
        (BLOCKS, "min_modules: {Rope: 2}", "min_modules.Rope: there is no module"),
        (BLOCKS, "modules: []", "constraints.modules"),
        (BLOCKS, "modules: [Brace]\n  min_modules: {Winch: 2}", "Winch is not among the task's"),
        ("  duration_s: 10", "  duration_s: 10\n  tracked_blocks: []", "tracked_blocks"),
        ("  cargo: {", "  # cargo: {", "scoring: the cargo is judged, but scenario has no cargo"),
        ("  min_time_s: 3", "  min_time_s: 11", "longer than the trial"),
        (SUPPORT, "name: transport\n  subject: cargo", "scenario.control.mode must be agent"),
        (SUPPORT, "name: height", "nothing fires"),
        (
            f"placement: {{kind: span, gap: 10}}\nscoring:\n  {SUPPORT}",
            "control: {mode: held}\nscoring:\n  name: height",
            "windows within the trial",
        ),
    ]:
        with subtests.test(old=old):
            assert old in OWN
            with pytest.raises(TaskError, match=re.escape(says)):
                load_task(OWN.replace(old, new))


def test_a_tasks_document_is_the_task_again(tasks) -> None:
    for task in (*tasks.values(), load_task(OWN)):
        assert load_task(yaml.safe_dump(dict(task.as_document()))) == task


def test_a_missing_file_is_named() -> None:
    with pytest.raises(TaskError, match=r"nowhere\.yaml"):
        load_task("nowhere.yaml")
