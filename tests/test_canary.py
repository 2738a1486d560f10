"""Benchmark data can be recognised in a corpus, and documents hold no whole solution."""

import json
import re
from pathlib import Path

import pytest
from support.documents.what_a_model_sees import page as what_a_model_sees
from support.machines import drive_machines

from buildarena_backend.agents.briefing import briefing
from buildarena_benchmark import CANARY, builtin_tasks
from buildarena_benchmark.experts import expert_designs

ROOT = Path(__file__).parents[1]
NUMBER = CANARY.rpartition(" ")[2]
MAX_TOLD = 0.5
"""The greatest share of a solution's calls that a document may have."""


@pytest.fixture(scope="module")
def solutions() -> dict[str, list[set[str]]]:
    """The expert's calls for each task, each in the spellings that documents and logs have."""
    spelled = {}
    for task, make in expert_designs().items():
        actions = [action for part in make(0).parts.values() for action in part.actions]
        calls = {json.dumps(arguments): (name, dict(arguments)) for name, arguments in actions}
        spelled[task] = [spellings(*call) for call in calls.values()]
    return spelled


def spellings(name: str, arguments: dict) -> set[str]:
    values = [value for value in arguments.values() if value]
    quoted = json.dumps({"tool": name, "arguments": arguments})
    return {
        bare(f"{name}: {', '.join(map(str, values))}"),
        bare(f"{name} {arguments}"),
        bare(f"{name}({json.dumps(values)[1:-1]})"),
        bare(quoted),
    }


def bare(line: str) -> str:
    """A line without what lists, blocks, logs and notebooks put around it."""
    return re.sub(
        r"[^\w:.-]+|\\n", " ", re.sub(r"^\W*(\d+\.\s)?(\w+\.(?=\w+\())?", "", line)
    ).strip()


def told_share(text: str, calls: list[set[str]]) -> float:
    """The share of a solution's calls that a text has on lines of their own."""
    lines = {bare(line) for line in text.splitlines()}
    return sum(not lines.isdisjoint(call) for call in calls) / len(calls)


def documents() -> list[Path]:
    folders = ("docs", "libs", "services", "clients", "integrations", "examples", "deploy")
    endings, left = (".md", ".ipynb"), {"node_modules", "dist", ".venv"}
    found = [page for end in endings for page in ROOT.glob(f"*{end}")]
    found += [page for end in endings for at in folders for page in (ROOT / at).rglob(f"*{end}")]
    pages = [page for page in found if not left & set(page.parts)]
    assert len(pages) > 60
    return pages


def test_statements_and_solutions_have_the_canary_and_no_model_reads_it() -> None:
    tasks = ROOT / "libs/benchmark/src/buildarena_benchmark/tasks"
    patterns = ("*/*.yaml", "*/expert.py", "*/*.lua", "*/README.md")
    sources = [file for pattern in patterns for file in tasks.glob(pattern)]
    assert len(sources) > len(builtin_tasks())
    assert not [file.name for file in sources if NUMBER not in file.read_text(encoding="utf-8")]
    assert NUMBER in drive_machines.written()
    told = {task.name: task.statement + briefing(task) for task in builtin_tasks().values()}
    assert not [name for name, text in told.items() if NUMBER in text]


def test_no_document_holds_a_whole_solution_or_tells_most_of_one(solutions) -> None:
    found = []
    for page in documents():
        text = page.read_text(encoding="utf-8")
        found += [page for calls in solutions.values() if told_share(text, calls) > MAX_TOLD]
    assert not found


def test_a_page_with_a_solution_would_be_found(solutions) -> None:
    (part,) = expert_designs()["support-1"](0).parts.values()
    forms = (
        lambda name, given: f"1. {name}: {', '.join(str(v) for v in given.values() if v)}",
        lambda name, given: f"    {name} {given}",
        lambda name, given: "- " + json.dumps({"tool": name, "arguments": given}),
    )
    for form in forms:
        page = "\n".join(form(name, dict(given)) for name, given in part.actions)
        assert told_share(page, solutions["support-1"]) > MAX_TOLD


@pytest.mark.ci
def test_machines_in_what_models_read_are_cut_short(solutions) -> None:
    page = what_a_model_sees()
    assert NUMBER in page
    assert max(told_share(page, calls) for calls in solutions.values()) <= MAX_TOLD
