"""Benchmark data can be recognised in a corpus, and documents hold no whole solution."""

import re
from pathlib import Path

import pytest
from support.documents.what_a_model_sees import BEGINNING, LISTED, PAGE

from buildarena_benchmark import CANARY, builtin_tasks
from buildarena_pipeline.agents.briefing import briefing

ROOT = Path(__file__).parents[1]
NUMBER = CANARY.rpartition(" ")[2]
SOURCES = [
    *sorted((ROOT / "libs/benchmark/src/buildarena_benchmark/tasks/catalogue").glob("*.yaml")),
    *sorted((ROOT / "services/worker/src/buildarena_worker/builtin/designs").glob("*.py")),
    *sorted((ROOT / "services/worker/src/buildarena_worker/builtin/designs").rglob("*.lua")),
    ROOT / "integrations/gymnasium/src/buildarena_gymnasium/machines.json",
    ROOT / "docs/expert.md",
    PAGE,
]
STEP = re.compile(r"^\W*(\d+\. )?(attach_block_to|connect_blocks)\b")


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.name)
def test_statements_and_solutions_have_the_canary(source) -> None:
    assert len(SOURCES) > len(builtin_tasks())
    assert NUMBER in source.read_text(encoding="utf-8")


@pytest.mark.parametrize("task", builtin_tasks().values(), ids=lambda task: task.name)
def test_no_model_reads_the_canary(task) -> None:
    assert NUMBER not in task.statement
    assert NUMBER not in briefing(task)


@pytest.mark.parametrize("page", sorted((ROOT / "docs").glob("*.md")), ids=lambda path: path.name)
def test_no_document_holds_a_whole_solution(page) -> None:
    steps = 0
    for line in page.read_text(encoding="utf-8").splitlines():
        steps = steps + 1 if STEP.match(line) else 0
        assert steps <= BEGINNING + 1, f"{page.name} goes on with a solution: {line}"


def test_machines_in_what_models_read_are_cut_short() -> None:
    listed = 0
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        listed = listed + 1 if LISTED.match(line) else 0
        assert listed <= BEGINNING + 1
