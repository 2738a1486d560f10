"""The command ``buildarena report``: a sweep's results as tables and plots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from buildarena_cli.client import Client, at
from buildarena_cli.errors import CommandError
from buildarena_cli.ids import whole_id
from buildarena_cli.options import DEFAULT_URL, PolicyName, PolicyOption, UrlOption
from buildarena_cli.terminal.completion import complete_sweep
from buildarena_cli.terminal.output import say

if TYPE_CHECKING:
    from buildarena_benchmark.flags import ScoringPolicy
    from buildarena_benchmark.leaderboard import EndedJob

ENDINGS = (".html", ".md", ".pdf")
PLAIN: Final[Mapping[str, Any]] = {
    "workflow": "five-role",
    "prompts": "default",
    "data_sheets": True,
    "one_shot": False,
    "closed_loop": None,
    "worlds": None,
}
PLAIN_DECODING: Final[Mapping[str, Any]] = {"temperature": 0.5, "top_p": 0.7}
"""The paper's main experiment; what differs from it names a variant."""


def report(
    sweeps: Annotated[
        list[str],
        typer.Argument(
            help="Ids of sweeps, or their beginnings; several are set side by side.",
            autocompletion=complete_sweep,
        ),
    ],
    out: Annotated[Path, typer.Option("--out", help="File: .html, .md or .pdf.")],
    policy: PolicyOption = PolicyName.OURS,
    url: UrlOption = DEFAULT_URL,
) -> None:
    """Write a report of sweeps: tables and plots.

    They stand beside the paper's figures.
    """
    if out.suffix not in ENDINGS:
        raise CommandError(f"{out}: the name must end in {', '.join(ENDINGS)}")
    from buildarena_cli.report.sections import sections
    from buildarena_cli.report.writing import write_report

    client = Client(url)
    material = collect(client, [whole_id(client, "sweep", id_) for id_ in sweeps], policy)
    try:
        write_report(sections(material), out)
    except OSError as error:
        raise CommandError(f"{out} can't be written: {error.strerror}") from error
    say(f"{out}: {len(material.trials):,} jobs")


def collect(client: Client, ids: Sequence[str], policy: str = "ours") -> Any:
    """Reads what a report of these sweeps is made of, with flags read as asked.

    Sweeps of different workflows, prompts or decodings are set side by side: each becomes a row
    of its own, named by what differs from the paper's main experiment.
    """
    from buildarena_benchmark.flags import ScoringPolicy
    from buildarena_cli.report.custom_tasks import read_tasks
    from buildarena_cli.report.material import Material

    sweeps = [client.get(at("sweeps", id_)) for id_ in dict.fromkeys(ids)]
    variants = {sweep["id"]: variant(sweep["spec"]) for sweep in sweeps}
    several = len(set(variants.values())) > 1
    registry = {entry["name"]: entry["model"] for entry in client.get("/v1/models")}
    trials: dict[str, EndedJob] = {}
    rounds: dict[str, list[tuple[bool, float]]] = {}
    snapshots: dict[str, str] = {}
    verdicts: dict[tuple[str, str], dict[str, tuple[bool, float]]] = {}
    for sweep in sweeps:
        named = variants[sweep["id"]] or "main"
        for result in client.get(at("sweeps", sweep["id"], "results")):
            row = f"{result['model']} ({named})" if several else result["model"]
            # The paper's main table is of the main experiment alone.
            if not variants[sweep["id"]]:
                snapshots[row] = registry.get(result["model"], "")
            rounds[result["job_id"]] = [
                _verdict(r, ScoringPolicy(policy)) for r in result["rounds"]
            ]
            for made in result["rounds"]:
                tried = verdicts.setdefault((result["task"], made["machine"]), {})
                tried[sweep["spec"]["simulator"]] = _verdict(made, ScoringPolicy(policy))
            trials[result["job_id"]] = _trial(result, row)
    progress = [sweep["progress"] for sweep in sweeps]
    return Material(
        policy=ScoringPolicy(policy),
        title=", ".join(dict.fromkeys(sweep["name"] for sweep in sweeps)),
        tasks=read_tasks(client, list(trials.values())),
        trials=list(trials.values()),
        rounds=rounds,
        snapshots=snapshots,
        verdicts=verdicts,
        unfinished=sum(p["total"] - p["done"] for p in progress),
    )


def variant(spec: Mapping[str, Any]) -> str:
    """What of a sweep differs from the paper's main experiment; "" for nothing."""
    from buildarena_simulation import DEFAULT_ENGINE

    main = {"simulator": DEFAULT_ENGINE, **PLAIN}
    settings = {name: spec.get(name, plain) for name, plain in main.items()}
    loop = settings["closed_loop"]
    parts = [
        settings[name]
        for name in ("workflow", "simulator", "prompts")
        if settings[name] != main[name]
    ]
    if not settings["data_sheets"]:
        parts.append("no data sheets")
    if settings["worlds"] is not None:
        parts.append(f"{settings['worlds']} worlds")
    if settings["one_shot"]:
        parts.append("one-shot")
    if loop:
        parts.append(f"{loop['rounds']} rounds" + (" + analyst" if loop["analyst"] else ""))
    decoding = {
        key: value
        for key, value in spec.get("decoding", PLAIN_DECODING).items()
        if value is not None
    }
    parts += [
        f"{key.replace('_', ' ')} {decoding.get(key, 'default')}"
        for key in sorted({*decoding, *PLAIN_DECODING})
        if decoding.get(key) != PLAIN_DECODING.get(key)
    ]
    return ", ".join(parts)


def _verdict(made: Mapping[str, Any], policy: ScoringPolicy) -> tuple[bool, float]:
    """Success and indicator of a simulated machine, under a scoring policy."""
    from buildarena_benchmark.flags import ScoringPolicy, is_disqualified

    if policy == ScoringPolicy.OURS and is_disqualified(made["flags"]):
        return False, 0.0
    return made["success"], made["indicator"]


def _trial(result: Mapping[str, Any], row: str) -> EndedJob:
    from buildarena_benchmark.leaderboard import EndedJob

    values = {name: result[name] for name in EndedJob.__dataclass_fields__ if name in result}
    values |= {"model": row, "flags": tuple(result["flags"])}
    if row != result["model"]:
        values["configuration"] = f"{row} {result['configuration']}"
    return EndedJob(**values)
