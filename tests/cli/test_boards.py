"""The leaderboard's overview: models x tasks, as wide as there is room for, nothing left out."""

from typing import Any

import pytest

from buildarena_cli.terminal import boards
from buildarena_cli.terminal.boards import overview

TASKS = [f"{kind}-{level}" for kind in ("transport", "support", "lift") for level in (1, 2, 3)]
MODELS = ["builtin/expert", "openai/gpt-5", "x/" + "long-name-" * 3]


def row(place: int, model: str, task: str) -> dict[str, Any]:
    return {
        "model": model,
        "configuration": "c",
        "baseline": model.startswith("builtin/"),
        "decoding": {},
        "by_runner": 0,
        "unverified": 0,
        "refuted": 0,
        "successes": place,
        "trials": 4,
        "success_low": 0.1,
        "success_high": 0.9,
        "too_few_data": False,
        "indicator_mean": 1000.0 * place + TASKS.index(task),
    }


def board(models: list[str], tasks: list[str]) -> dict[str, Any]:
    return {
        "tasks": [
            {
                "task": task,
                "indicator": "height" if task.startswith("lift") else "distance",
                "unit": "units",
                "rows": [row(n, model, task) for n, model in enumerate(models, 1)],
            }
            for task in tasks
        ],
        "overall": [
            {"model": model, "configuration": "c", "rank": n} for n, model in enumerate(models, 1)
        ],
        "flags": [],
    }


@pytest.fixture
def shown(capsys, monkeypatch):
    def show(width: int | None, models: list[str] = MODELS, tasks: list[str] = TASKS) -> list[str]:
        if width is not None:
            monkeypatch.setattr(boards, "is_terminal", lambda: True)
            monkeypatch.setattr(boards, "terminal_width", lambda: width)
        overview(board(models, tasks))
        return capsys.readouterr().out.splitlines()

    return show


def test_a_pipe_gets_one_line_for_each_model(shown) -> None:
    lines = shown(None)
    head, first = lines[:2]
    assert head.split() == ["#", "model", *TASKS]
    assert first.split("  ")[0] == "1"
    assert "builtin/expert*" in first
    assert first.count("1/4  10-90 %  1,00") == 9
    assert "  lift-1, lift-2, lift-3: height in units" in lines


@pytest.mark.parametrize("width", [300, 200, 150, 100, 80, 60])
def test_a_terminal_gets_every_figure_within_its_width(shown, width) -> None:
    lines = shown(width)
    table = lines[
        : lines.index("Successes of jobs, the rate's exact 95 % interval, and the mean indicator:")
    ]
    assert max(map(len, table)) <= width
    text = "\n".join(table)
    for place in (1, 2, 3):
        for task in range(9):
            assert f"{place},00{task}.0" in text
    assert text.count("10-90 %") == 27


def test_intervals_give_way_where_not_one_column_fits(shown) -> None:
    text = "\n".join(lines := shown(30, models=MODELS[:2]))
    table = lines[
        : lines.index("Successes of jobs, the rate's exact 95 % interval, and the mean indicator:")
    ]
    assert max(map(len, table)) <= 30
    assert "10-90 %" not in text
    assert "2/4  2,008.0" in text


def test_few_models_become_columns_where_that_takes_fewer_blocks(shown) -> None:
    lines = shown(90, models=MODELS[:2])
    assert lines[0].split() == ["model", "builtin/expert*", "openai/gpt-5"]
    assert lines[1].split() == ["#", "1", "2"]
    assert [line.split()[0] for line in lines[2:11]] == TASKS


def test_what_was_not_tried_is_a_dash(shown, capsys) -> None:
    made = board(MODELS, TASKS[:2])
    made["tasks"][1]["rows"].pop()
    made["overall"][2]["rank"] = None
    overview(made)
    last = capsys.readouterr().out.splitlines()[3]
    assert last.split()[0] == "-"
    assert last.split()[-3:] == ["-", "-", "-"]
    assert shown
