"""Evidence as a table: what was assumed, expected and seen, and how far engines and game agree."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pydantic import BaseModel, Field

from buildarena_benchmark.statistics import exact_interval
from buildarena_pipeline.evidence.assumptions import ASSUMPTIONS
from buildarena_pipeline.evidence.document import Evidence, StepRecord, Verdict
from buildarena_pipeline.evidence.steps import STEPS


class EvidenceRow(BaseModel):
    """What one step says of one assumption."""

    step: str
    assumption: str
    assumed: str
    expected: str
    seen: str
    verdict: Verdict
    stated: Verdict | None = Field(
        description="The sender's own verdict, where the files say something else"
    )


class EngineAgreement(BaseModel):
    """How often an engine gives the expert's machine the game's verdict; "all" for all tasks."""

    task: str
    engine: str
    simulation_version: str
    trials: int
    same_verdict: int
    share: float
    low: float = Field(description="Lower end of the share's exact 95 % interval")
    high: float


class EvidenceTable(BaseModel):
    """Everything that evidence says, judged from its files."""

    game: str
    mod: str
    build: str
    rows: list[EvidenceRow]
    agreement: list[EngineAgreement]


def table_of(evidence: Evidence) -> EvidenceTable:
    """The table of evidence whose steps are judged."""
    versions = evidence.versions
    return EvidenceTable(
        game=versions.game,
        mod=versions.mod,
        build=versions.build,
        rows=list(_rows(evidence)),
        agreement=list(_agreement(evidence.steps)),
    )


def _rows(evidence: Evidence) -> Iterator[EvidenceRow]:
    for step in evidence.steps:
        for entry in step.judgements:
            assumption = ASSUMPTIONS.get(entry.assumption)
            if assumption is not None:
                yield EvidenceRow(
                    step=step.name,
                    assumption=assumption.name,
                    assumed=assumption.text,
                    expected=assumption.expected,
                    seen=entry.seen,
                    verdict=entry.verdict,
                    stated=entry.stated,
                )


def _agreement(steps: Sequence[StepRecord]) -> Iterator[EngineAgreement]:
    totals: dict[tuple[str, str], list[bool]] = {}
    for step in steps:
        known = STEPS.get(step.name)
        if known is None or "agreement" not in known.assumes:
            continue
        verdicts = [
            figures.get("success")
            for name, figures in step.figures.items()
            if name.startswith("game")
        ]
        for engine, record in step.engines.items():
            ours = record.figures.get("success")
            if ours is None or not verdicts:
                continue
            same = [verdict == ours for verdict in verdicts]
            totals.setdefault((engine, record.simulation), []).extend(same)
            yield _row(known.trial, engine, record.simulation, same)
    for (engine, version), same in totals.items():
        yield _row("all", engine, version, same)


def _row(task: str, engine: str, version: str, same: Sequence[bool]) -> EngineAgreement:
    low, high = exact_interval(sum(same), len(same))
    return EngineAgreement(
        task=task,
        engine=engine,
        simulation_version=version,
        trials=len(same),
        same_verdict=sum(same),
        share=sum(same) / len(same),
        low=low,
        high=high,
    )
