from __future__ import annotations

import re
from pathlib import Path

import pytest

from buildarena_benchmark import flags, scorers
from buildarena_benchmark.flags import DISQUALIFYING, INFORMATIVE, PUBLISHED, Reading

DOCS = Path(__file__).parents[2] / "docs" / "statistics.md"
KNOWN = {**DISQUALIFYING, **INFORMATIVE}


def test_a_flag_is_of_one_kind_and_says_one_sentence() -> None:
    assert not DISQUALIFYING.keys() & INFORMATIVE.keys()
    assert KNOWN.keys() >= PUBLISHED
    for name, sentence in KNOWN.items():
        assert re.fullmatch(r"[A-Z][^.]*\.", sentence), name
        assert flags.meaning(name) == sentence
    assert flags.meaning("a flag of tomorrow") == ""


def test_scorers_give_no_flag_that_nobody_knows() -> None:
    found = set()
    for file in Path(scorers.__file__).parent.glob("*.py"):
        for section in re.findall(r"Flags:\n(.*?)\n\n", file.read_text(), re.DOTALL):
            found.update(re.findall(r"`(\w+)`:", section))
    assert found >= {"no_wheels", "start_too_high", "never_fell", "twr_below_one"}
    assert found <= KNOWN.keys()


def test_the_documentation_says_the_same() -> None:
    rows = re.findall(
        r"^\| `(\w+)` \| (\w+) \| ([\w ]*) ?\| (.*) \|$", DOCS.read_text(), re.MULTILINE
    )
    assert {(name, kind, out.strip(), says) for name, kind, out, says in rows} == {
        (
            name,
            "disqualifying" if name in DISQUALIFYING else "informative",
            "left out" if name in PUBLISHED else "",
            says,
        )
        for name, says in KNOWN.items()
    }


@pytest.mark.parametrize(
    ("given", "disqualified", "left_out", "censored"),
    [
        ((), False, False, False),
        (("never_fell",), False, True, True),
        (("never_fell", "does_not_span"), True, True, True),
        (("unstable",), True, False, False),
        (("span_not_measured", "drive_not_measured"), False, False, False),
        (("a flag of tomorrow",), False, False, False),
    ],
)
def test_what_flags_do(given, disqualified, left_out, censored) -> None:
    assert flags.is_disqualified(given) == disqualified
    assert flags.is_left_out(given, Reading.PUBLISHED) == left_out
    assert not flags.is_left_out(given, Reading.OURS)
    assert flags.is_censored(given) == censored
