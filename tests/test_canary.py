"""Benchmark data can be recognised in a corpus, and documents hold no whole solution."""

import json
import re
from pathlib import Path

import pytest
from support.documents.what_a_model_sees import BEGINNING, LISTED
from support.documents.what_a_model_sees import page as what_a_model_sees
from support.machines import drive_machines

from buildarena_benchmark import CANARY, builtin_tasks
from buildarena_pipeline.agents.briefing import briefing
from buildarena_worker.builtin.designs import DESIGNS

ROOT = Path(__file__).parents[1]
NUMBER = CANARY.rpartition(" ")[2]
SOURCES = [
    *sorted((ROOT / "libs/benchmark/src/buildarena_benchmark/tasks/catalogue").glob("*.yaml")),
    *sorted((ROOT / "services/worker/src/buildarena_worker/builtin/designs").glob("*.py")),
    *sorted((ROOT / "services/worker/src/buildarena_worker/builtin/designs").rglob("*.lua")),
    ROOT / "docs/expert.md",
]
MAX_TOLD = 0.5
"""The greatest share of a solution's calls that a document may have."""
DOCUMENTS = [
    page
    for pattern in ("*.md", "*.ipynb")
    for folder in ("", "docs", "libs", "services", "clients", "integrations", "examples", "deploy")
    for page in sorted((ROOT / folder).glob(f"**/{pattern}" if folder else pattern))
    if not {"node_modules", "dist", ".venv"} & set(page.parts)
]
STEP = re.compile(r"^\W*(\d+\. )?(attach_block_to|connect_blocks)\b")


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.name)
def test_statements_and_solutions_have_the_canary(source) -> None:
    assert len(SOURCES) > len(builtin_tasks())
    assert NUMBER in source.read_text(encoding="utf-8")


def test_machines_that_are_driven_have_the_canary() -> None:
    assert NUMBER in drive_machines.written()


@pytest.mark.parametrize("task", builtin_tasks().values(), ids=lambda task: task.name)
def test_no_model_reads_the_canary(task) -> None:
    assert NUMBER not in task.statement
    assert NUMBER not in briefing(task)


@pytest.fixture(scope="module")
def solutions() -> dict[str, list[set[str]]]:
    """The expert's calls for each task, each in the spellings that documents and logs have."""
    spelled = {}
    for task, make in DESIGNS.items():
        design = make(0)
        actions = [action for part in design.parts.values() for action in part.actions]
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


@pytest.mark.parametrize("page", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_document_tells_most_of_a_solution(page, solutions) -> None:
    text = page.read_text(encoding="utf-8")
    told = {task: told_share(text, calls) for task, calls in solutions.items()}
    assert not {task: share for task, share in told.items() if share > MAX_TOLD}


@pytest.mark.parametrize(
    "form",
    [
        lambda n, name, given: f"{n}. {name}: {', '.join(str(v) for v in given.values() if v)}",
        lambda _, name, given: f"    {name} {given}",
        lambda _, name, given: f"machine.{name}{tuple(v for v in given.values() if v)}".replace(
            "'", '"'
        ),
        lambda _, name, given: "- " + json.dumps({"tool": name, "arguments": given}),
    ],
)
def test_a_page_with_a_solution_would_be_found(form, solutions) -> None:
    (part,) = DESIGNS["support-1"](0).parts.values()
    page = "\n".join(form(n, name, dict(given)) for n, (name, given) in enumerate(part.actions, 1))
    assert told_share(page, solutions["support-1"]) > MAX_TOLD


@pytest.mark.parametrize("page", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_document_holds_a_whole_solution(page) -> None:
    assert longest_passage(page.read_text(encoding="utf-8"), STEP) <= BEGINNING + 1


def longest_passage(text: str, form: re.Pattern[str]) -> int:
    """How many lines of a form a text has at most, one below the other."""
    counts = [0]
    for line in text.splitlines():
        counts.append(counts[-1] + 1 if form.match(line) else 0)
    return max(counts)


@pytest.mark.ci
def test_machines_in_what_models_read_are_cut_short(solutions) -> None:
    page = what_a_model_sees()
    assert NUMBER in page
    assert max(told_share(page, calls) for calls in solutions.values()) <= MAX_TOLD
    assert longest_passage(page, STEP) <= BEGINNING + 1
    assert longest_passage(page, LISTED) <= BEGINNING + 1
