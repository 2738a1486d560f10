"""The paper's own figures, put through our mathematics."""

import csv
import math
import re
from itertools import combinations
from pathlib import Path

import pytest

from buildarena_benchmark import paper_tasks
from buildarena_benchmark.leaderboard import (
    cost_table,
    performance_table,
    published_rows,
)
from buildarena_benchmark.statistics import difference_interval

OPEN_WEIGHT = {"Qwen3.5-9B", "Qwen3.5-27B", "Ministral-14B"}
MARKS = Path(__file__).parents[2] / "data" / "leaderboard" / "paper_marks.csv"
# The paper underlines 19.3, though 19.0 of the same column is less.
MISMARKED = {
    ("support-2", "output_tokens_mean", "DeepSeek-3.1", "second"),
    ("support-2", "output_tokens_mean", "GPT-4o", "second"),
}
COLUMNS = {
    performance_table: ("parts_mean", "success_rate", "indicator_mean"),
    cost_table: ("input_tokens_mean", "output_tokens_mean", "requests_mean"),
}


def test_the_papers_models_are_on_each_of_its_tasks() -> None:
    assert list(published_rows()) == list(paper_tasks())
    assert {len(rows) for rows in published_rows().values()} == {12}
    gpt = published_rows()["support-1"][0]
    assert (gpt.model, gpt.successes, gpt.trials, gpt.indicator_mean) == ("GPT-5", 55, 64, 324.9)


def test_our_tables_mark_what_the_paper_marks(subtests) -> None:
    for table in [performance_table, cost_table]:
        with subtests.test(table=table):
            frontier = {
                task: [row for row in rows if row.model not in OPEN_WEIGHT]
                for task, rows in published_rows().items()
            }
            found, category = set(), ""
            for line in table(frontier).splitlines():
                if heading := re.match(r"\\multirow\{9\}\{\*\}\{(\w+)\}", line):
                    category = heading[1].lower()
                cells = [cell.strip(" \\") for cell in line.split("&")]
                if not category or len(cells) != 11:
                    continue
                for place, cell in enumerate(cells[2:]):
                    mark = {"text": "best", "unde": "second"}.get(cell[:4])
                    if mark:
                        figure = COLUMNS[table][place // 3]
                        found.add((f"{category}-{place % 3 + 1}", figure, cells[1], mark))
            with MARKS.open() as file:
                marks = {
                    (row["task"], row["figure"], row["model"], row["mark"])
                    for row in csv.DictReader(file)
                    if row["figure"] in COLUMNS[table]
                }
            assert found ^ marks <= MISMARKED


def test_at_64_samples_only_about_a_third_of_the_pairs_differ() -> None:
    pairs = [
        difference_interval((a.successes, a.trials), (b.successes, b.trials))
        for rows in published_rows().values()
        for a, b in combinations(rows, 2)
    ]
    assert len(pairs) == 9 * math.comb(12, 2)
    apart = sum(low > 0 or high < 0 for low, high in pairs)
    assert apart / len(pairs) == pytest.approx(1 / 3, abs=0.03)


def test_table_text_is_safe_for_latex() -> None:
    row = published_rows()["lift-1"][0]

    class Odd:
        model = "a_b&c%"
        parts_mean = success_rate = indicator_mean = None

    text = performance_table({"lift-1": [row, Odd()]})
    assert r"a\_b\&c\%" in text
    assert "& -- & -- & -- &" in text
