"""How far our engines say the same as the game."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from pydantic import BaseModel, Field

from buildarena_benchmark.statistics import agreement, exact_interval
from buildarena_store.boards import Annotated


class AgreementRow(BaseModel):
    """One engine on one task."""

    task: str
    engine: str
    simulation_version: str
    trials: int
    same_verdict: float = Field(description="Share that both call a success, or both do not")
    low: float = Field(description="Lower end of its exact 95 % interval")
    high: float
    kappa: float | None = Field(description="Cohen's kappa of the verdicts")
    near: float | None = Field(
        description="Share of common successes whose indicators differ by a quarter at most"
    )
    rank_correlation: float | None = Field(description="Spearman's, of the indicators")


class AgreementTable(BaseModel):
    """All engines on all tasks of one track in the game; empty for other tracks."""

    track: str | None
    rows: list[AgreementRow]


def agreement_rows(annotated: Sequence[Annotated]) -> list[AgreementRow]:
    """The table's rows.

    Args:
        annotated: Trials, sorted or not.
    """

    def kind(one: Annotated) -> tuple[str, str, str]:
        return (one.task, one.engine, one.version)

    rows = []
    for (task, engine, version), group in groupby(sorted(annotated, key=kind), key=kind):
        trials = list(group)
        found = agreement([one.game for one in trials], [one.ours for one in trials])
        if found is None:
            continue
        same = round(found.same_verdict * found.trials)
        low, high = exact_interval(same, found.trials)
        rows.append(
            AgreementRow(
                task=task,
                engine=engine,
                simulation_version=version,
                trials=found.trials,
                same_verdict=found.same_verdict,
                low=low,
                high=high,
                kappa=found.kappa,
                near=found.near,
                rank_correlation=found.rank_correlation,
            )
        )
    return rows
