"""The task catalogue: nine tasks, their versions, and errors in a user's own."""

from pathlib import Path

import pytest
import yaml

from buildarena_benchmark import Task, TaskError, load_task

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


def test_there_are_nine_tasks_in_three_categories(tasks: dict[str, Task]) -> None:
    assert list(tasks) == [f"{c}-{n}" for c in ("transport", "support", "lift") for n in (1, 2, 3)]
    for name, task in tasks.items():
        assert (task.category, task.level) == (name[:-2], int(name[-1]))
        assert set(task.difficulty) == {
            "quantification",
            "robustness",
            "magnitude",
            "compositionality",
            "precision",
            "ambiguity",
        }
        assert all(1 <= weight <= 3 for weight in task.difficulty.values())


def test_each_task_has_the_papers_scenario(tasks: dict[str, Task]) -> None:
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


def test_a_statement_tells_what_the_scorer_measures(tasks: dict[str, Task]) -> None:
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


def test_a_users_own_task_loads_from_text_and_file(tmp_path: Path) -> None:
    task = load_task(OWN)
    assert (task.name, task.scorer, task.control) == ("tower-bridge", "support", "none")
    file = tmp_path / "own.yaml"
    file.write_text(OWN, encoding="utf-8")
    assert load_task(file) == task == load_task(str(file))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("final_mass: 300", "final_mass: 301"),
        ("min_time_s: 3", "min_time_s: 2"),
        ("over a gap of 10", "over a gap of ten"),
        ("max_blocks: 100", "max_blocks: 99"),
        ("duration_s: 10", "duration_s: 11"),
    ],
)
def test_what_can_change_a_score_changes_the_version(old: str, new: str) -> None:
    assert load_task(OWN.replace(old, new)).version != load_task(OWN).version


def test_what_cannot_change_a_score_keeps_the_version() -> None:
    renamed = OWN.replace("A suspended bridge", "Another title").replace("tower-bridge", "other")
    assert load_task(renamed).version == load_task(OWN).version
    reordered = yaml.safe_dump(yaml.safe_load(OWN), sort_keys=True)
    assert load_task(reordered).version == load_task(OWN).version


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ("  min_time_s: 3", "  min_tim_s: 3", ["line 18", "scoring.min_tim_s", "min_time_s"]),
        ("name: support\n", "name: suport\n", ["scoring", "'transport', 'support'"]),
        ("gap: 10}", "gap: -1}", ["line 15", "scenario.placement.gap", "greater than 0"]),
        ("kind: span", "kind: hover", ["placement", "'ground', 'span'"]),
        ("duration_s: 10", "duration_s: 10.01", ["duration_s", "0.04"]),
        ("title: A suspended bridge\n", "", ["title", "required"]),
        ("max_blocks: 100", "max_blocks: many", ["line 8", "constraints.max_blocks", "integer"]),
        ("indicator: {", "indicator: [", ["no valid YAML"]),
    ],
)
def test_an_error_names_line_field_and_choices(old: str, new: str, parts: list[str]) -> None:
    assert old in OWN
    with pytest.raises(TaskError) as caught:
        load_task(OWN.replace(old, new))
    for part in parts:
        assert part in str(caught.value)


def test_a_missing_file_is_named() -> None:
    with pytest.raises(TaskError, match=r"nowhere\.yaml"):
        load_task("nowhere.yaml")
