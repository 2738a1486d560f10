"""Writes docs/performance.md from what `make bench` has kept: `make generate NAME=performance`.

A benchmark whose figures are missing is named with the command that measures it.
"""

import json
import platform
import re
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import psutil
from benchmarks import scale, simulation

ROOT: Final = Path(__file__).parents[1]
PAGE: Final = ROOT / "docs" / "performance.md"
KEPT: Final = ROOT / ".buildarena"


class Row(NamedTuple):
    """A figure, with what it is measured against."""

    name: str
    value: float
    bar: float | None = None
    unit: str = ""
    published: str = ""
    at_least: bool = False

    def cells(self) -> Iterator[str]:
        """The figure as a line of the table."""
        yield self.name
        yield f"{self.value:,.4g} {self.unit}".strip()
        yield "" if self.bar is None else f"{'at least ' * self.at_least}{self.bar:g}"
        yield "" if self.bar is None else f"{self.value / self.bar:.2f}"
        yield self.published
        peers = [float(number) / self.value for number in re.findall(r"[\d.]+", self.published)]
        yield " to ".join(f"{peer:,.3g}" for peer in peers)


def of_geometry(kept: list[dict[str, Any]]) -> list[Row]:
    return [Row(k["name"], k["value"], k["bar"], k["unit"], k["published"]) for k in kept]


def of_trials(kept: dict[str, Any]) -> list[Row]:
    return [
        Row(f"{words(name)}, {engine}", kept[engine][name], bar, unit_of(name))
        for engine, bars in kept["bars"].items()
        for name, bar in bars.items()
    ]


def of_sessions(kept: dict[str, Any]) -> list[Row]:
    about = f", {kept['sessions']} sessions"
    bars = {name: bar.split() for name, bar in kept["bars"].items()}
    return [
        Row(words(name) + about, kept[name], float(bar), unit_of(name), at_least=sign == ">=")
        for name, (sign, bar) in bars.items()
    ]


def of_scale(kept: dict[str, Any]) -> list[Row]:
    rows = []
    for name, bar in scale.BARS.items():
        spread = kept[name] if isinstance(kept[name], dict) else {"": kept[name]}
        for part, value in spread.items():
            rows.append(Row(f"{words(name)} {part}".strip(), value, bar, unit_of(name)))
    return rows


def of_api(kept: dict[str, Any]) -> list[Row]:
    large, steady, heard = kept["large_sweep"], kept["submitting"], kept["listeners"]
    cost = kept["overhead"]
    return [
        Row(f"sweep of {large['jobs']:,} jobs accepted", large["accepted_s"], large["bar_s"], "s"),
        Row("a job submitted, median", steady["p50_ms"], None, "ms"),
        Row("a job submitted, 99 %", steady["p99_ms"], steady["bar_ms"], "ms"),
        Row(f"an event to {heard['listeners']} listeners", heard["longest_delay_s"], None, "s"),
        Row("processor time of a job", cost["overhead_ms_a_job"], cost["bar_ms"], "ms"),
    ]


def of_simulation(kept: dict[str, Any]) -> list[Row]:
    return [
        Row(f"{name}, {engine}", value, simulation.BARS.get((name, engine)), "s")
        for name, engines in kept["speed"].items()
        if name != "growth"
        for engine, value in engines.items()
    ]


def of_agreement(kept: dict[str, Any]) -> list[Row]:
    return [
        Row(f"same verdict, share of {kept['count']}", kept["same_verdict"], 0.95, at_least=True),
        Row("indicators close, where both succeed", kept["close"], 0.9, at_least=True),
    ]


def of_statistics(kept: dict[str, Any]) -> list[Row]:
    return [
        Row("least coverage, rates", min(r["exact"] for r in kept["rates"]), 0.95, at_least=True),
        Row("least coverage, mean indicators", kept["least_coverage"]),
        Row("boards with a false claim, most", max(row["false"] for row in kept["claims"]), 0.05),
        Row(
            "all tests of a board, longest",
            max(row["seconds"] for row in kept["claims"]),
            None,
            "s",
        ),
    ]


def of_dashboard(kept: dict[str, Any]) -> list[Row]:
    names = ("first_shown_ms", "grid_shown_ms", "all_jobs_read_ms", "click_median_ms")
    more = ("longest_task_after_load_ms", "heap_mib_most")
    return [Row(words(name), kept[name], None, unit_of(name)) for name in (*names, *more)]


BENCH: Final = "make bench NAME={}"
IN_A_BROWSER: Final = (
    "node clients/web/scripts/measure-sweep.mjs URL SWEEP SECONDS >.buildarena/bench-{}.json"
)
SECTIONS: Final[dict[str, tuple[str, Callable[[Any], list[Row]], str]]] = {
    "geometry": ("Geometry, beside the published library", of_geometry, BENCH),
    "trials": ("Trials", of_trials, BENCH),
    "simulation": ("Processor time of a simulated second", of_simulation, BENCH),
    "sessions": ("Sessions of one construct process", of_sessions, BENCH),
    "scale": ("Boards, lists and claims at 200,000 ended and as many queued jobs", of_scale, BENCH),
    "api": ("The API", of_api, BENCH),
    "dashboard": ("The dashboard, on a sweep's page", of_dashboard, IN_A_BROWSER),
    "agreement": ("Agreement of the engines", of_agreement, BENCH),
    "statistics": ("Statistics", of_statistics, BENCH),
}
"""By benchmark: its heading, what reads its figures, and the command that measures them."""
HEAD: Final = """# Performance

Made by `make generate NAME=performance` from what `make bench NAME=…` has measured. Times are
medians unless a line says otherwise; a share of the bar above 1 misses it, except where more is
better (*at least*). The last column says how many times the published library's figure is ours.

"""


def words(name: str) -> str:
    """Return a figure's name without its unit."""
    return re.sub(r"_(ms|s|mb|mib)(?=_|$)", "", name).replace("_", " ")


def unit_of(name: str) -> str:
    """Return the unit that a figure's name has, if any."""
    found = re.search(r"_(ms|s|mb|mib)(?=_|$)", name)
    return {"mb": "MB", "mib": "MiB"}.get(found[1], found[1]) if found else ""


def machine() -> str:
    """Name the machine and the commit, as a table."""
    info = Path("/proc/cpuinfo")
    models = re.findall(r"model name\s*: (.+)", info.read_text()) if info.exists() else []
    said = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    named = {
        "processor": models[0] if models else platform.processor() or platform.machine(),
        "cores": psutil.cpu_count(),
        "memory": f"{psutil.virtual_memory().total / 2**30:.0f} GiB",
        "Python": platform.python_version(),
        "commit": said.stdout.strip(),
    }
    return table(["machine", ""], [[name, str(value)] for name, value in named.items()])


def table(head: list[str], rows: list[list[str]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def section(name: str) -> str:
    """Return a benchmark's table, or how to measure what it would have."""
    heading, read, command = SECTIONS[name]
    file, said = KEPT / f"bench-{name}.json", f"`{command.format(name)}`"
    if not file.exists():
        return f"\n## {heading}\n\nNot measured: {said}.\n"
    rows = [list(row.cells()) for row in read(json.loads(file.read_text(encoding="utf-8")))]
    head = ["figure", "measured", "bar", "of the bar", "published library", "times"]
    while not any(row[len(head) - 1] for row in rows):
        head.pop()
    return f"\n## {heading}\n\n{said}\n\n{table(head, [row[: len(head)] for row in rows])}"


if __name__ == "__main__":
    PAGE.write_text(HEAD + machine() + "".join(map(section, SECTIONS)), encoding="utf-8")
