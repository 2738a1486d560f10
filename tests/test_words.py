"""Words that the glossary replaced do not come back. Pure text: nothing is imported or started."""

from __future__ import annotations

import ast
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

# The changelog and migrations tell what was renamed; recorded data is what it was; prompts and
# geometry's texts are what models read, and change only with their versions.
EXCLUDED = (
    "CHANGELOG.md",
    "LICENSE",
    "libs/store/src/buildarena_store/migrations/",
    "requirements",
    "tests/data/",
    "tests/test_words.py",
    "libs/benchmark/src/buildarena_benchmark/leaderboard/published.csv",
    "libs/benchmark/src/buildarena_benchmark/tasks/catalogue/",
    "libs/geometry/src/",
    "libs/pipeline/src/buildarena_pipeline/catalog/prompts/",
)
ENDINGS = {".md", ".py", ".toml", ".yaml", ".mk", ".sh", ".j2", ".json", ".in", "", ".ini", ".mako"}

WORDS = (
    (r"\bnudg(e|ed|es|ing)\b|\bnudged_at\b", "notify"),
    (r"\bsweepers?\b", "reaper"),
    (r"\bturnstiles?\b", "concurrency gate"),
    (r"\bPassingFault\w*|\bpassing faults?\b", "transient fault, TransientError"),
    (
        r"\btaken?_up\b|\btake_?up\b|\bTakeUp\b|\b(take|takes|taken|took|taking) up again\b",
        "resume",
    ),
    (r"\bdeaf\b", "stalled"),
    (r"(?-i:\bMOST_[A-Z])", "MAX_"),
    (r"(?-i:\bLEAST_[A-Z])", "MIN_"),
    (r"\bGatheredStore\b", "BatchedRedis"),
    (r"\bwas_too_much\b", "rejected"),
    (r"\bwent_well\b", "succeeded"),
    (r"\bduels?\b", "comparison"),
    (r"\bjolts?\b", "impact"),
    (r"\boutside agents?\b", "external agent"),
    (r"\bown tasks?\b|\bown_tasks?\b", "custom task"),
    (r"\bat the most\b", "at most"),
    (r"\bfor ever\b", "forever"),
    (r"\bcan't be told apart\b|\bcannot be told apart\b", "statistically tied"),
    (r"\bset(s|ting)? fire\b|\bby fire\b", "inject faults"),
    (r"\bwrong words\b", "usage error"),
    (r"\bis no (YAML|JSON|UTF-8)\b", "is not valid …"),
    (r"\bSimulationRoom\w*", "SimulationError"),
    (r"(?-i:\bGuards\b)", "BodyLimitMiddleware"),
    (r"\b_guard\b", "_lock"),
    (r"\b(put|puts|putting) aside\b", "reserve"),
    (r"\b(get|gets|getting) on\b", "make progress"),
    (r"\broads? of (a|the|one) job\b", "job lifecycle"),
    (r"\bFieldError\b|\bFieldProblem\b", "ValidationIssue"),
    (r"\btrial_?books\b", "trial repository"),
    (r"\bLeaseWish\b|\bwishes\b", "lease request, lease queue"),
    (r"\bhanding_in\b|\bhand_in\b", "submission"),
    (r"\bis_aside\b", "lookup only"),
    (r"\bhopeless\b", "infeasible"),
    (r"\bmade_tables\b|\bmade tables\b", "derived tables"),
    (r"\bdead_links?\b", "keepalive"),
    (r"(?-i:\bSurroundingsMetrics\b)", "infrastructure metrics"),
    (r"(?-i:\bKept[A-Z]\w*|\bKEPT_\w+)", "stored, cached"),
    (r"\bnear_words\b|\brun_instead\b", "suggestions, exec"),
    (r"(?-i:\bReadingName\b|\bREADINGS\b)", "scoring policy"),
    (r"\bMOVING_SEATS\b|\bSeatJoint\b", "joint type"),
    (r"\bconduct\.md\b", "guidelines"),
    (r"(?-i:\bServiceFigures\b|\bJobFigures\b)", "metrics"),
    (r"\bis told in\b|\bso much as\b", "a plain sentence"),
    (r"\bas it is said\b", "a plain sentence"),
    (r"\bscreen[./](hands|eyes)\b|(?-i:\bHands\()", "screen.input, screen.capture"),
    (r"\bhands and eyes\b|\beyes and hands\b", "input and capture"),
    (r"\bHingedPiece\b|\bis_simple_piece\b", "component"),
    (r"(?-i:\b_?LOCK_TRIES\b|\b_GUID_TRIES\b)", "attempts"),
)
INSTEAD = {f"word{number}": instead for number, (_, instead) in enumerate(WORDS)}
PATTERN = re.compile(
    r"\b(?=\w)(?:"
    + "|".join(f"(?P<word{number}>{word})" for number, (word, _) in enumerate(WORDS))
    + ")",
    re.IGNORECASE,
)
"""All old words at once, looked for where a word begins: a group for each says which one it is."""

EMPTY_NAMES = frozenset({"found", "one", "again", "kept", "told", "said", "given"})
"""Names of variables that do not say what they hold."""
NAMED_PACKAGES = (
    "libs/besiege",
    "libs/benchmark",
    "libs/geometry",
    "libs/simulation",
    "services/simworker",
    "services/simworker-besiege",
    "clients/buildarena",
    "clients/cli",
    "clients/python",
)
"""Packages without such names."""


def tracked() -> list[str]:
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if listed.returncode:
        pytest.skip("this is not a checkout")
    return [
        name
        for name in listed.stdout.split("\0")
        if Path(name).suffix in ENDINGS
        and not name.startswith(EXCLUDED)
        and (ROOT / name).is_file()
    ]


def findings(name: str, text: str) -> list[str]:
    """Old words of a text, each with its place and the word to use."""
    return [
        f"{name}:{text.count(chr(10), 0, found.start()) + 1}: "
        f"{found[0]!r}: say {INSTEAD[str(found.lastgroup)]!r}"
        for found in PATTERN.finditer(text)
    ]


@pytest.mark.ci
def test_old_words_do_not_come_back() -> None:
    names = tracked()
    assert len(names) > 300
    found = [line for name in names for line in findings(name, (ROOT / name).read_text())]
    assert not found, "\n" + "\n".join(found)


@pytest.mark.parametrize("package", NAMED_PACKAGES)
def test_variables_say_what_they_hold(package: str) -> None:
    files = sorted((ROOT / package / "src").rglob("*.py"))
    assert files
    empty = [
        f"{file.relative_to(ROOT)}:{node.lineno}: {name}"
        for file in files
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.Name | ast.arg)
        and (name := node.id if isinstance(node, ast.Name) else node.arg) in EMPTY_NAMES
    ]
    assert not empty, "\n" + "\n".join(empty)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("The sweeper nudges workers.", ["'sweeper': say 'reaper'", "'nudges': say 'notify'"]),
        ("MOST_ROWS = 3", ["'MOST_R': say 'MAX_'"]),
        ("a task of your own, held for 3 s, the most it can bear", []),
    ],
)
def test_an_old_word_is_named_with_the_one_to_use(text: str, says: list[str]) -> None:
    assert [line.removeprefix("a.md:1: ") for line in sorted(findings("a.md", text))] == sorted(
        says
    )


def test_the_glossary_has_no_head_word_twice() -> None:
    rows = re.findall(
        r"^\| (\*\*.*?) \|", (ROOT / "docs" / "glossary.md").read_text(), re.MULTILINE
    )
    heads = [head.lower() for row in rows for head in re.findall(r"\*\*(.*?)\*\*", row)]
    assert len(heads) > 50
    assert sorted(heads) == sorted(set(heads))
