"""`buildarena challenge`: packages against a season's rules, here or handed in to a service."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from buildarena_cli.client import Client
from buildarena_cli.errors import DONE, FAILED, CommandError
from buildarena_cli.given_paths import to_read, to_read_or_name
from buildarena_cli.lazy import new_group
from buildarena_cli.options import DEFAULT_URL, JsonOption, UrlOption
from buildarena_cli.terminal.output import (
    columns,
    minute_of,
    number,
    print_json,
    print_table,
    say,
)

if TYPE_CHECKING:
    from buildarena_pipeline.challenges.checking import Report
    from buildarena_pipeline.challenges.season import Season

app = new_group("Check what is handed in to a challenge.")
DEFAULT_SEASON: Final = "s01-stable-orbit"

SeasonName = Annotated[
    str, typer.Argument(help="Name of a season, or the path of its YAML file.", show_default=False)
]
ServedSeason = Annotated[str, typer.Argument(help="Name of a season of the service.")]
PackageId = Annotated[str, typer.Argument(help="Id of the package.")]
SeasonOption = Annotated[
    str, typer.Option("--season", help="Name of a season, or the path of its YAML file.")
]
ServedSeasonOption = Annotated[
    str, typer.Option("--season", help="Name of a season of the service.")
]
TrackOption = Annotated[
    str | None, typer.Option("--track", help="Track; the season's first if left out.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="A parameter of the score that nobody published, such as omega_ref=0.24 or "
        "center=0,-400,0.",
    ),
]


@app.command("list")
def list_seasons(*, as_json: JsonOption = False) -> None:
    """List the seasons that the product knows."""
    from buildarena_pipeline.challenges.season import builtin_seasons

    seasons = builtin_seasons().values()
    if as_json:
        print_json([season.model_dump(mode="json") for season in seasons])
        return
    rows = [[season.name, season.title, ", ".join(season.tracks)] for season in seasons]
    print_table(columns("name", "title", "tracks"), rows)


@app.command("show")
def show_season(season: SeasonName, *, as_json: JsonOption = False) -> None:
    """Show a season: its files, rules and score, and what of it nobody published."""
    with _spelled():
        chosen = _season(season, None)
    if as_json:
        print_json({**chosen.model_dump(mode="json"), "unknown": list(chosen.unknown)})
        return
    say(f"{chosen.name}: {chosen.title}")
    say(chosen.about)
    for name, track in chosen.tracks.items():
        say(f"  track {name}: {track.title}")
    say(f"files: {', '.join((*chosen.score.file_names, chosen.transcript))}")
    say(f"score: {chosen.score.in_words}")
    if chosen.unknown:
        say(f"not published: {', '.join(chosen.unknown)}; give them with --set")
    for source in chosen.sources:
        say(f"source: {source}")


@app.command("check")
def check(
    package: Annotated[
        Path, typer.Argument(help="Folder or ZIP file with the package's files.", callback=to_read)
    ],
    season: SeasonOption = DEFAULT_SEASON,
    track: TrackOption = None,
    settings: SetOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Check a package against every rule of its season, and score it; exit code 1 if it fails."""
    from buildarena_pipeline.challenges.checking import check_package
    from buildarena_pipeline.challenges.package import read_package

    with _spelled():
        chosen = _season(season, settings)
        report = check_package(read_package(package), chosen, track or next(iter(chosen.tracks)))
    if as_json:
        print_json({**asdict(report), "passed": report.passed})
    else:
        _print_report(report)
    raise typer.Exit(DONE if report.passed else FAILED)


@app.command("table")
def table(
    folder: Annotated[
        Path, typer.Argument(help="Folder of packages: folders and ZIP files.", callback=to_read)
    ],
    season: SeasonOption = DEFAULT_SEASON,
    track: TrackOption = None,
    settings: SetOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Check all packages of a folder, rank them by what is known, and show near-copies."""
    from buildarena_pipeline.challenges.judging import judge_folder

    with _spelled():
        chosen = _season(season, settings)
        entries = judge_folder(folder, chosen, track or next(iter(chosen.tracks)))
    if as_json:
        print_json([asdict(entry) for entry in entries])
        return
    rows = [
        [
            entry.name,
            "" if entry.rank is None else str(entry.rank),
            "" if entry.score is None else number(entry.score.known, 2),
            "" if entry.score is None else number(entry.score.at_most, 2),
            "" if entry.score is None else str(entry.score.cost),
            ", ".join(entry.copies),
            entry.refused,
        ]
        for entry in entries
    ]
    shown = columns(
        "entry",
        "rank",
        "known",
        "at most",
        "cost",
        "same as",
        "refused",
        numeric=("rank", "known", "at most", "cost"),
    )
    print_table(shown, rows)


@app.command("submit")
def submit(
    package: Annotated[
        Path, typer.Argument(help="Folder or ZIP file with the package's files.", callback=to_read)
    ],
    name: Annotated[str, typer.Option("--name", help="What the entry is called.")],
    season: ServedSeasonOption = DEFAULT_SEASON,
    track: Annotated[str, typer.Option("--track", help="Track.")] = "autopilot",
    *,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Hand in a package to a service, which checks it within seconds."""
    from buildarena_pipeline.challenges.package import zipped_package

    with _spelled():
        data = zipped_package(package)
    done = Client(url).submit_package(data, season=season, track=track, name=name)
    if as_json:
        print_json(done)
        return
    say(f"{done['id']}: {'handed in' if done['added'] else 'was there before; nothing changed'}")
    say(f"`buildarena challenge package {done['id']}` shows what its checks find")


@app.command("package")
def show_package(
    package: PackageId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False
) -> None:
    """Show a package that was handed in, with every check."""
    shown = Client(url).package(package)
    if as_json:
        print_json(shown)
        return
    say(f"{shown['id']}: {shown['name']}, {shown['season']}, {shown['track']}, {shown['state']}")
    if shown["reason"]:
        say(shown["reason"])
    report = shown["report"] or {}
    rows = [
        [each["check"], "ok" if each["passed"] else "FAILED", each["sentence"]]
        for each in report.get("findings", [])
    ]
    if rows:
        print_table(columns("check", "", "found"), rows)
    if shown["points"] is not None:
        say(f"{shown['points']:.2f} points, cost {shown['cost']}")
    for change in shown["changes"]:
        say(f"{change['at']}: {change['state_before']} → {change['state']}: {change['reason']}")


@app.command("board")
def board(
    season: ServedSeason,
    track: Annotated[str, typer.Option("--track", help="Track.")] = "autopilot",
    *,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Show a season's board: equal points share a rank."""
    rows = Client(url).season_board(season, track)
    if as_json:
        print_json(rows)
        return
    cells = [
        [
            *(str(row["rank"]), entry["name"], number(entry["points"], 2), str(entry["cost"])),
            *(minute_of(entry["created_at"]), entry["state"], entry["id"]),
        ]
        for row in rows
        for entry in (row["package"],)
    ]
    shown = columns(
        *("rank", "name", "points", "cost", "handed in", "state", "id"),
        numeric=("rank", "points", "cost"),
    )
    print_table(shown, cells)


@app.command("decide")
def decide(
    package: PackageId,
    state: Annotated[str, typer.Argument(help="accepted or refused.")],
    reason: Annotated[str, typer.Option("--reason", help="Why; it stays with the package.")],
    *,
    url: UrlOption = DEFAULT_URL,
) -> None:
    """Accept or refuse a package that was checked; for admins."""
    done = Client(url).decide_package(package, state=state, reason=reason)
    say(f"{done['id']}: {done['state']}")


@app.command("withdraw")
def withdraw(package: PackageId, *, url: UrlOption = DEFAULT_URL) -> None:
    """Take a package off its board."""
    done = Client(url).withdraw_package(package)
    say(f"{done['id']}: {done['state']}")


@app.command("audit")
def audit(
    season: ServedSeason, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False
) -> None:
    """Show who decided what of a season's packages, and why; for admins."""
    changes = Client(url).season_changes(season)
    if as_json:
        print_json(changes)
        return
    cells = [
        [
            *(minute_of(change["at"]), change["changed_by"] or "operator", change["name"]),
            f"{change['state_before']} -> {change['state']}",
            *(change["reason"], change["package"]),
        ]
        for change in changes
    ]
    print_table(columns("at", "by", "entry", "change", "reason", "package"), cells)


def _season(name: str, settings: list[str] | None) -> Season:
    from buildarena_pipeline.challenges.season import season_named

    return season_named(to_read_or_name(name)).with_parameters(
        dict(map(_parameter, settings or ()))
    )


def _parameter(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals:
        raise CommandError(f"--set {text[:60]}: expected NAME=VALUE, such as omega_ref=0.24")
    try:
        numbers = [float(part) for part in value.split(",")]
    except ValueError:
        raise CommandError(
            f"--set {name[:60]}: expected a number, or three with commas between them"
        ) from None
    return name.strip(), numbers if len(numbers) > 1 else numbers[0]


@contextmanager
def _spelled() -> Iterator[None]:
    from buildarena_pipeline.challenges.package import PackageError
    from buildarena_pipeline.challenges.season import SeasonError

    try:
        yield
    except (PackageError, SeasonError) as error:
        raise CommandError(str(error)) from error


def _print_report(report: Report) -> None:
    rows = [
        [finding.check, "ok" if finding.passed else "FAILED", finding.sentence]
        for finding in report.findings
    ]
    print_table(columns("check", "", "found"), rows)
    score = report.score
    if score is None:
        say("No score: what is scored breaks a rule.")
        return
    rows = [
        [
            term.name,
            "?" if term.share is None else number(term.points * term.share, 2),
            f"{term.points:g}",
            term.sentence,
        ]
        for term in score.terms
    ]
    print_table(columns("term", "points", "of", "figures", numeric=("points", "of")), rows)
    say(f"cost {score.cost}; performance {_known(score.performance)}; final {_known(score.final)}")
    if score.unknown:
        say(
            f"Known are {score.known:.2f} points, {score.at_most:.2f} at most; not published, to "
            f"be given with --set: {', '.join(score.unknown)}"
        )


def _known(points: float | None) -> str:
    return "not known" if points is None else f"{points:.2f}"
