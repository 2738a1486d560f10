"""The sentence on top of a board: who is best, and whether the trials show it."""

import re

from buildarena_benchmark.leaderboard import OverallRow, verdict_of

BASELINES = {"builtin/expert", "builtin/idle"}


def row(model: str, rank: int | None, high: int = 1, rate: float = 0.5, **values) -> OverallRow:
    usual = {
        "configuration": f"{model} by default",
        "rank_low": rank,
        "rank_high": None if rank is None else high,
        "mean_rank": rank,
        "missing": () if rank else ("lift-1",),
        "score_mean": None,
        "trials": 40,
        "success_rate_mean": rate,
        "cost_usd_mean": None,
        "output_tokens_mean": None,
        "pareto": False,
        "dimensions": {},
    }
    return OverallRow(model=model, rank=rank, **{**usual, **values})


def sentence(*rows: OverallRow, tasks: int = 4) -> str:
    verdict = verdict_of(rows, tasks, BASELINES.__contains__)
    assert verdict is not None
    return verdict.sentence


def test_one_that_is_better_than_all_others_is_best() -> None:
    rows = [row("a", 1, 1, 0.9), row("b", 2, 3, 0.3), row("c", 2, 3, 0.2)]
    verdict = verdict_of(rows, 4, BASELINES.__contains__)
    assert (verdict.proven, verdict.leaders, verdict.seeds_to_separate) == (True, ["a"], None)
    assert verdict.sentence == (
        "a is best on these 4 tasks, better than each of the 2 other ranked models beyond chance: "
        "90 % of its trials succeed."
    )


def test_one_that_only_leads_is_not_called_best() -> None:
    rows = [row("a", 1, 2, 0.9), row("b", 2, 3, 0.6), row("c", 3, 3, 0.2)]
    verdict = verdict_of(rows, 1, BASELINES.__contains__)
    assert not verdict.proven
    assert verdict.sentence == (
        "a stands first on this task (90 % of its trials succeed), but is better beyond chance "
        "than only 1 of the 2 other ranked models."
    )


def test_tied_leaders_are_told_how_many_seeds_would_separate_them() -> None:
    rows = [row("a", 1, 2, 0.6), row("b", 1, 2, 0.4), row("c", 3, 3, 0.0)]
    verdict = verdict_of(rows, 4, BASELINES.__contains__)
    assert verdict.leaders == ["a", "b"]
    assert not verdict.proven
    # 3 pairs x 5 rankings: 2 ((z(1 - 0.05/30) + z(0.8)) / (asin difference))^2 / 4.
    assert verdict.seeds_to_separate == 44
    assert "About 44 seeds of each on each task would tell a from b" in verdict.sentence
    assert "if 60 % and 40 % of their trials" in verdict.sentence


def test_seeds_that_would_not_help_are_not_told() -> None:
    equal = [row("a", 1, 2, 0.5), row("b", 1, 2, 0.5)]
    assert "seeds" not in sentence(*equal)
    many = [row("a", 1, 2, 0.6, trials=4000), row("b", 1, 2, 0.4, trials=4000)]
    assert "seeds" not in sentence(*many), "so many were made, and they are tied all the same"


def test_a_tie_of_many_names_three() -> None:
    rows = [row(name, 1, 5) for name in "abcde"]
    assert sentence(*rows).startswith("a, b, c and 2 others are tied for first")


def test_leaders_need_not_stand_next_to_each_other() -> None:
    rows = [row("a", 1, 3, 0.6), row("b", 2, 3, 0.5), row("c", 1, 3, 0.4)]
    assert sentence(*rows).startswith("a and c are tied for first")


def test_where_nobody_is_best_it_says_so(subtests) -> None:
    for rows, says in [
        ([row("a", None)], "Nobody is ranked yet: no model has counted jobs on all 4 tasks."),
        (
            [row("a", 1, 2, 0.0), row("b", 1, 2, 0.0), row("c", None, rate=0.5)],
            "Nobody is best on these 4 tasks: no ranked model has succeeded.",
        ),
        (
            [row("a", 1, 1, 0.25), row("b", None)],
            "a alone is ranked on these 4 tasks: 25 % of its trials succeed.",
        ),
    ]:
        with subtests.test(rows=rows):
            assert sentence(*rows) == says


def test_a_baseline_in_front_leaves_room_for_the_best_model() -> None:
    rows = [row("builtin/expert", 1, 1, 1.0), row("a", 2, 3), row("b", 2, 3)]
    said = sentence(*rows)
    assert said.startswith("builtin/expert (a baseline) is best")
    assert said.endswith("The best model that is no baseline is a, at place 2 to 3.")


def test_configurations_of_one_model_are_told_apart() -> None:
    rows = [
        row("a", 1, 2, 0.6, configuration="11112222333"),
        row("a", 1, 2, 0.5, configuration="44445555666"),
    ]
    assert re.match(r"a \(11112222\) and a \(44445555\) are tied", sentence(*rows))


def test_an_empty_board_says_nothing() -> None:
    assert verdict_of([], 4, BASELINES.__contains__) is None
