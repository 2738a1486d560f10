"""The page of evidence: assumption, expected, seen, verdict; one file, escaped text only."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping
from html import escape
from typing import Final

from buildarena_pipeline.evidence.archive_names import PNG
from buildarena_pipeline.evidence.document import Evidence, StepRecord, Verdict
from buildarena_pipeline.evidence.steps import STEPS
from buildarena_pipeline.evidence.table import EvidenceTable, table_of

MAX_PICTURES: Final = 24
MAX_PICTURE_BYTES: Final = 500_000
_WORDS: Final = {
    Verdict.CONFIRMED: "confirmed",
    Verdict.CONTRADICTED: "contradicted",
    Verdict.NOT_SEEN: "not seen",
}
_STYLE: Final = """
body { font: 15px/1.45 system-ui, sans-serif; max-width: 75rem; margin: 2rem auto; padding: 0 1rem;
  color: #1c2430; background: #fff }
table { border-collapse: collapse; width: 100%; margin: 1rem 0 }
th, td { text-align: left; vertical-align: top; padding: .35rem .6rem;
  border-bottom: 1px solid #d5dbe3 }
.confirmed { color: #11663b } .contradicted { color: #a3201d; font-weight: 600 }
.not_seen { color: #5c6673 }
img { max-width: 20rem; margin: .3rem; border: 1px solid #d5dbe3 }
"""
_POLICY: Final = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"


def page(evidence: Evidence, files: Mapping[str, bytes]) -> str:
    """The page of evidence whose steps are judged.

    Args:
        evidence: The evidence.
        files: Its files, of which pictures are shown.
    """
    return "".join(_parts(evidence, files))


def _parts(evidence: Evidence, files: Mapping[str, bytes]) -> Iterator[str]:
    table, versions = table_of(evidence), evidence.versions
    yield '<!doctype html><html lang="en"><meta charset="utf-8"><title>A first evening</title>'
    yield f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}"><style>{_STYLE}</style>'
    yield "<h1>A first evening with the game</h1><p>"
    screen = "" if evidence.screen is None else f", {evidence.screen[0]} x {evidence.screen[1]}"
    yield escape(
        f"Besiege {versions.game or 'of unknown version'} (build {versions.build or 'unknown'}), "
        f"mod {versions.mod or 'unknown'} (file: {versions.mod_file or 'unknown'}), driven by "
        f"{evidence.driver}{screen}; BuildArena {versions.buildarena}; "
        f"{evidence.made_at:%Y-%m-%d %H:%M} UTC"
    )
    yield "</p><h2>Assumptions</h2>"
    yield from _table(
        ("assumption", "assumed", "expected", "seen", "step", "verdict"),
        (
            (row.assumption, row.assumed, row.expected, row.seen, row.step, row.verdict)
            for row in table.rows
        ),
    )
    yield from _agreement(table)
    yield "<h2>Steps</h2>"
    shown = 0
    for step in evidence.steps:
        yield from _step(step)
        for name in sorted(files):
            fits = len(files[name]) <= MAX_PICTURE_BYTES and files[name].startswith(PNG)
            if name.startswith(f"steps/{step.name}/") and fits and shown < MAX_PICTURES:
                shown += 1
                data = base64.b64encode(files[name]).decode()
                what = escape(name.rpartition("/")[2], quote=True)
                yield f'<img alt="{what}" title="{what}" src="data:image/png;base64,{data}">'
    yield "</html>\n"


def _agreement(table: EvidenceTable) -> Iterator[str]:
    if table.agreement:
        yield "<h2>Engines and game, the expert's machines</h2>"
        yield from _table(
            ("task", "engine", "runs", "same verdict", "95 % interval"),
            (
                (
                    row.task,
                    f"{row.engine} ({row.simulation_version})",
                    str(row.trials),
                    f"{row.share:.0%}",
                    f"{row.low:.0%} to {row.high:.0%}",
                )
                for row in table.agreement
            ),
        )


def _step(step: StepRecord) -> Iterator[str]:
    known = STEPS.get(step.name)
    title = step.name if known is None else f"{step.name}: {known.title}"
    state = step.state.replace("_", " ")
    yield f"<h3>{escape(title)}</h3><p>{escape(': '.join(filter(None, (state, step.detail))))}</p>"
    if step.points:
        yield from _table(
            ("point", "", "detail"),
            ((point.name, "ok" if point.ok else "!!", point.detail) for point in step.points),
        )
    names = list(dict.fromkeys(name for figures in step.figures.values() for name in figures))
    if names:
        yield from _table(
            ("", *names),
            (
                (source, *(_number(figures.get(name)) for name in names))
                for source, figures in step.figures.items()
            ),
        )
    for run in step.runs:
        for fault in run.faults:
            yield f"<p>{escape(f'Run {run.number} needed another try: {fault}')}</p>"


def _table(heads: tuple[str, ...], rows: Iterator[tuple[str, ...]]) -> Iterator[str]:
    yield "<table><tr>" + "".join(f"<th>{escape(head)}</th>" for head in heads) + "</tr>"
    for row in rows:
        yield "<tr>" + "".join(map(_cell, row)) + "</tr>"
    yield "</table>"


def _cell(text: str) -> str:
    if isinstance(text, Verdict):
        return f'<td class="{text.value}">{_WORDS[text]}</td>'
    return f"<td>{escape(text)}</td>"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:g}"
