import re
from pathlib import Path

from buildarena_benchmark import flags
from buildarena_benchmark.flags import ScoringPolicy
from buildarena_benchmark.scorers.registry import known_flags, known_scorers

DOCS = Path(__file__).parents[2] / "docs" / "statistics.md"


def test_a_flag_says_one_sentence() -> None:
    for name, flag in known_flags().items():
        assert re.fullmatch(r"[A-Z][^.]*\.", flag.meaning), name
        assert flags.meaning(name) == flag.meaning
    assert flags.meaning("a flag of tomorrow") == ""


def test_a_scorer_documents_the_flags_that_it_declares(subtests) -> None:
    for name in known_scorers():
        with subtests.test(name=name):
            scorer = known_scorers()[name]
            section = re.search(
                r"Flags:\n(.*?)\n\n", (scorer.judge.__doc__ or "") + "\n\n", re.DOTALL
            )
            documented = set(re.findall(r"`(\w+)`:", section[1])) if section else set()
            assert documented == {flag.name for flag in scorer.flags}


def test_the_documentation_says_the_same() -> None:
    rows = re.findall(
        r"^\| `(\w+)` \| (\w+) \| ([\w ]*) ?\| (.*) \|$", DOCS.read_text(), re.MULTILINE
    )
    assert {(name, kind, out.strip(), says) for name, kind, out, says in rows} == {
        (
            name,
            "disqualifying" if flag.disqualifying else "informative",
            "left out" if flag.published else "",
            flag.meaning,
        )
        for name, flag in known_flags().items()
    }


def test_what_flags_do(subtests) -> None:
    for given, disqualified, left_out, censored in [
        ((), False, False, False),
        (("never_fell",), False, True, True),
        (("never_fell", "does_not_span"), True, True, True),
        (("unstable",), True, False, False),
        (("span_not_measured", "drive_not_measured"), False, False, False),
        (("a flag of tomorrow",), False, False, False),
    ]:
        with subtests.test(given=given):
            assert flags.is_disqualified(given) == disqualified
            assert flags.is_left_out(given, ScoringPolicy.PUBLISHED) == left_out
            assert not flags.is_left_out(given, ScoringPolicy.OURS)
            assert flags.is_censored(given) == censored
