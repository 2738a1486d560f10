"""Writes what is said of the game in documents; run by `make game-evidence`.

The table of agreement in docs/physics.md is made of published logs (`bench_game`), and of
evidence in tests/data/besiege/evidence; the table of assumptions in docs/besiege.md is made of
the data that pages of evidence have it from.
"""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from benchmarks.simulation.bench_game import KNOWN, TRIALS, logged, simulated

from buildarena_benchmark.statistics import exact_interval
from buildarena_pipeline.evidence import EvidenceTable, Verdict, read_evidence, table_of
from buildarena_pipeline.evidence.assumptions import assumptions_table
from buildarena_simulation import ENGINES

ROOT: Final = Path(__file__).parents[2]
EVENINGS: Final = ROOT / "tests" / "data" / "besiege" / "evidence"
BEGIN: Final = "<!-- made by `make game-evidence` -->\n"
END: Final = "<!-- end of what is made -->\n"
MACHINES: Final = {"seven blocks": "a straight beam of seven"}
"""How machines are read that their authors described, and did not publish."""
COLUMNS: Final = ("contact_s", "peak", "peak_s", "again_s", "crossing_s")
_HEADS: Final = (
    "| trial | machine | | verdict | first contact | peak | second contact | below 4 |",
    "|---|---|---|---|---|---|---|---|",
)
_NAMES: Final = {"pybullet": "PyBullet", "mujoco": "MuJoCo"}


def agreement_text() -> str:
    """How far engines and game agree."""
    evenings = [table_of(read_evidence(file.read_bytes()).evidence) for file in _files()]
    return "\n".join([*_published(), *(line for table in evenings for line in _evening(table)), ""])


MADE: Final[Mapping[str, Callable[[], str]]] = {
    "docs/besiege.md": lambda: f"{assumptions_table()}\n",
    "docs/physics.md": agreement_text,
}
"""What is made, by the document that has it."""


def written(name: str) -> str:
    """A document with what is made today.

    Args:
        name: One of `MADE`.

    Raises:
        ValueError: A mark is missing.
    """
    before, _, rest = (ROOT / name).read_text(encoding="utf-8").partition(BEGIN)
    _, mark, after = rest.partition(END)
    if not mark:
        raise ValueError(f"{name} has no marks {BEGIN.strip()} and {END.strip()}")
    return f"{before}{BEGIN}{MADE[name]()}{END}{after}"


def _files() -> list[Path]:
    return sorted(EVENINGS.glob("*.zip"))


def _published() -> Iterator[str]:
    yield from _HEADS
    agreeing: dict[str, list[bool]] = {engine: [] for engine in ENGINES}
    for name, (task, file, success, load) in TRIALS.items():
        machine = MACHINES.get(name, "not public")
        verdict = f"{load:.0f}" if success else "failed"
        yield _row(f"{name}, {task}", machine, "game", verdict, logged(file))
        if name in KNOWN:
            ours: Mapping[str, Any] = simulated(task, KNOWN[name])
            for engine, figures in ours.items():
                agreeing[engine].append(figures["success"] == success)
                verdict = f"{figures['load']:.0f}" if figures["success"] else "failed"
                yield _row("", "", _NAMES.get(engine, engine), verdict, figures)
    yield ""
    shares = (
        f"{_NAMES.get(engine, engine)} {_share(same)}" for engine, same in agreeing.items() if same
    )
    yield f"Same verdict as the game (exact 95 % interval), public machines: {', '.join(shares)}."


def _row(trial: str, machine: str, source: str, verdict: str, figures: Mapping[str, Any]) -> str:
    contact, peak, peak_s, again, crossing = (figures[name] for name in COLUMNS)
    high = "none" if peak is None else f"{peak:.2f} at {peak_s:.2f} s"
    cells = (trial, machine, source, verdict, _seconds(contact), high)
    return f"| {' | '.join((*cells, _seconds(again), _seconds(crossing)))} |"


def _evening(table: EvidenceTable) -> Iterator[str]:
    yield ""
    yield f"Besiege {table.game}, mod {table.mod}:"
    yield ""
    yield "| task | engine | runs | same verdict | 95 % interval |"
    yield "|---|---|---|---|---|"
    for row in table.agreement:
        engine = f"{_NAMES.get(row.engine, row.engine)} (version {row.simulation_version})"
        interval = f"{row.low:.0%} to {row.high:.0%}"
        yield f"| {row.task} | {engine} | {row.trials} | {row.share:.0%} | {interval} |"
    wrong = [row for row in table.rows if row.verdict is Verdict.CONTRADICTED]
    yield ""
    yield (
        "Contradicted: "
        + ("; ".join(f"{r.assumption}: {r.seen}" for r in wrong) or "nothing")
        + "."
    )


def _share(same: list[bool]) -> str:
    low, high = exact_interval(sum(same), len(same))
    return f"{sum(same)} of {len(same)} ({low:.0%} to {high:.0%})"


def _seconds(value: float | None) -> str:
    return "" if value is None else f"{value:.2f} s"


def main() -> None:
    """Writes the documents."""
    for name in MADE:
        (ROOT / name).write_text(written(name), encoding="utf-8")


if __name__ == "__main__":
    main()
