"""Verdict of a board in a sentence or two: the best model, and the evidence for it."""

import math
from collections.abc import Sequence

from pydantic import BaseModel, ConfigDict

from buildarena_benchmark.leaderboard.overall import OverallRow
from buildarena_benchmark.statistics.power import ERROR, trials_needed

NAMED = 3
"""Models that a sentence names; further ones are counted."""


class RankingVerdict(BaseModel):
    """Conclusion of the overall ranking, by the same tests as its ranks."""

    model_config = ConfigDict(frozen=True, use_attribute_docstrings=True)

    sentence: str
    """The best model, and whether the trials show it; for people."""
    leaders: list[str]
    """Models that share the first rank; none if no model is ranked or has succeeded."""
    proven: bool
    """Whether one model is better than every other ranked one beyond chance."""
    seeds_to_separate: int | None
    """Seeds of each model on each task that would separate the first two of several leaders, if
    their success rates stay as they are; null without a tie, and where more seeds would not
    help."""


def verdict_of(overall: Sequence[OverallRow], tasks: int) -> RankingVerdict | None:
    """Return the verdict of a ranking, by the same tests as its ranks; None without any row.

    Args:
        overall: Its rows, the best first.
    """
    if not overall:
        return None
    ranked = [row for row in overall if row.rank is not None]
    over = _over(tasks)
    if not ranked:
        return _no_leader(f"No model is ranked yet: only baselines have counted runs on {over}.")
    if not any(row.success_rate_mean for row in ranked):
        return _no_leader(f"No model is best on {over}: no ranked model has succeeded.")
    first = min(row.rank for row in ranked if row.rank is not None)
    leaders = [row for row in ranked if row.rank == first]
    # Every other model is known to be better or worse, and no ranked one is better.
    proven = len(ranked) > 1 and leaders[0].rank_high == leaders[0].rank_low
    seeds = None
    if len(leaders) > 1:
        seeds = _seeds(leaders[0], leaders[1], models=len(ranked), tasks=tasks)
        sentence = _tie(leaders, over, seeds)
    else:
        sentence = _lead(leaders[0], len(ranked) - 1, proven, tasks)
    return RankingVerdict(
        sentence=sentence,
        leaders=[row.model for row in leaders],
        proven=proven,
        seeds_to_separate=seeds,
    )


def _over(tasks: int) -> str:
    return "this task" if tasks == 1 else f"these {tasks} tasks"


def _no_leader(sentence: str) -> RankingVerdict:
    return RankingVerdict(sentence=sentence, leaders=[], proven=False, seeds_to_separate=None)


def _lead(leader: OverallRow, count: int, proven: bool, tasks: int) -> str:
    """Return the sentence about a single model in front."""
    name, over = leader.label, _over(tasks)
    share = f"{_percent(leader.success_rate_mean)} of its trials succeed"
    if leader.missing:
        share += f" on the {tasks - len(leader.missing)} that it ran"
    if not count:
        return f"{name} alone is ranked on {over}: {share}."
    rivals = "the other ranked model" if count == 1 else f"each of the {count} other ranked models"
    if proven:
        return f"{name} is best on {over}, better than {rivals} beyond chance: {share}."
    return f"{name} is first on {over} ({share}), but is not shown to be better than {rivals}."


def _tie(leaders: Sequence[OverallRow], over: str, seeds: int | None) -> str:
    """Return the sentence about several models in front."""
    names = [row.label for row in leaders]
    sentence = (
        f"{_list(names)} are tied for first on {over}: the trials do not show which is better."
    )
    first, second = leaders[0], leaders[1]
    rates = f"{_percent(first.success_rate_mean)} and {_percent(second.success_rate_mean)}"
    if seeds is None:
        return sentence
    return (
        f"{sentence} About {seeds:,} seeds of each on each task would separate {names[0]} from "
        f"{names[1]}, if {rates} of their trials go on to succeed."
    )


def _seeds(first: OverallRow, second: OverallRow, *, models: int, tasks: int) -> int | None:
    """Return the trials on each task that would separate two models, as `board_power` reckons.

    None where their success rates are equal, or where so many trials were made already: then it is
    not by their number that the two are tied.
    """
    rates = first.success_rate_mean, second.success_rate_mean
    if rates[0] is None or rates[1] is None:
        return None
    claims = math.comb(models, 2) * (tasks + 1 if tasks > 1 else 1)
    needed = trials_needed(rates[0], rates[1], error=ERROR / claims)
    if needed is None:
        return None
    each = math.ceil(needed / tasks)
    counted = min(first.counted, second.counted) / tasks
    return each if each > counted else None


def _list(names: Sequence[str]) -> str:
    shown = list(names[:NAMED])
    if len(names) > NAMED:
        shown.append(f"{len(names) - NAMED} others")
    return f"{', '.join(shown[:-1])} and {shown[-1]}"


def _percent(share: float | None) -> str:
    return "no" if share is None else f"{100 * share:.0f} %"
