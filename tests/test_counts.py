"""Numbers of tasks and tools that documents name are those of the catalogue."""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from buildarena_benchmark import builtin_tasks, paper_tasks
from buildarena_environment import Environment
from buildarena_geometry.modules.catalogue import basic_modules, extended_modules

ROOT = Path(__file__).parents[1]
# Decisions and the changelog say what was so at their date; the boards of these two are made up.
ELSEWHERE = ("CHANGELOG.md", "docs/decisions/", "docs/statistics.md", "docs/scaling.md")
ONES = """one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen
sixteen seventeen eighteen nineteen"""
TENS = "twenty thirty forty fifty sixty seventy eighty ninety"
WORDS = {word: n for n, word in enumerate(ONES.split(), 1)}
WORDS |= {word: 10 * n for n, word in enumerate(TENS.split(), 2)}
NUMBER = rf"\b(\d+|(?:{'|'.join(WORDS)})(?:-(?:{'|'.join(WORDS)}))?)"
DOCUMENTS = [
    file
    for pattern in (
        *("*.md", "docs/**/*.md", "examples/**/*.md", "libs/*/README.md", "libs/*/src/**/*.md"),
        *("clients/*/README.md", "services/*/README.md", "integrations/*/README.md"),
    )
    for file in sorted(ROOT.glob(pattern))
    if not str(file.relative_to(ROOT)).startswith(ELSEWHERE)
]


def number(told: str) -> int:
    """The number that a word or digits say."""
    return int(told) if told.isdigit() else sum(WORDS[part] for part in told.lower().split("-"))


def counts() -> dict[str, set[int]]:
    """What there is, by the noun that documents count it with."""
    tasks = builtin_tasks()
    return {
        "tasks": {len(tasks), len(paper_tasks()), *categories().values()},
        "tools": {len(Environment(name).observation.tools) for name in tasks},
        "module types": {len(basic_modules()), len(basic_modules() + extended_modules())},
        "levels of BesiegeField": {len(list(ROOT.glob("examples/tasks/besiegefield/*.yaml")))},
    }


def categories() -> Counter[str]:
    return Counter(task.category for task in builtin_tasks().values())


def told_in(text: str, noun: str) -> Iterator[int]:
    """The numbers that stand before a noun, or before `built-in` or `building` and the noun."""
    for told in re.findall(rf"{NUMBER} (?:built-in |building )?{noun}\b", text, re.IGNORECASE):
        yield number(told)


def wrong_in(text: str) -> list[str]:
    """The counts of a document that are of nothing in the catalogue."""
    wrong = [
        f"{told} {noun}, and there are {', '.join(map(str, sorted(right)))}"
        for noun, right in counts().items()
        for told in told_in(text, noun)
        if told not in right
    ]
    for told, category in re.findall(
        rf"{NUMBER} tasks are in the category `(\w+)`", text, re.IGNORECASE
    ):
        if number(told) != categories()[category]:
            wrong.append(f"{told} in {category}, and there are {categories()[category]}")
    return wrong


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda file: str(file.relative_to(ROOT)))
def test_documents_count_what_the_catalogue_has(document) -> None:
    assert not wrong_in(document.read_text())


def test_wrong_counts_are_found() -> None:
    assert wrong_in("It has eighty-eight tasks.")
    assert wrong_in("We offer 400 building tools.")
    assert wrong_in("Nine tasks are in the category `headroom`, all by name.")
    assert not wrong_in(
        f"There are {len(builtin_tasks())} tasks; the paper's nine tasks are ranked."
    )
