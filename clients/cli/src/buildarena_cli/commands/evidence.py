"""`buildarena besiege evidence`: what evenings with the real game showed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from buildarena_cli.client import Client
from buildarena_cli.errors import CommandError
from buildarena_cli.given_paths import to_read
from buildarena_cli.lazy import new_group
from buildarena_cli.options import DEFAULT_URL, JsonOption, UrlOption
from buildarena_cli.terminal.output import (
    columns,
    emphasised,
    print_json,
    print_table,
    say,
    warn,
)

if TYPE_CHECKING:
    from buildarena_client.schemas import EvidenceRow

app = new_group("Send and look at what evenings with the game showed.")


@app.command("add")
def add_evidence(
    file: Annotated[
        Path, typer.Argument(help="ZIP file that `besiege first-evening` wrote.", callback=to_read)
    ],
    *,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Send evidence of the game to the service, which reads its logs again; for admins."""
    try:
        done = Client(url).add_evidence(file)
    except OSError as error:
        raise CommandError(f"{file}: {error.strerror}") from error
    if as_json:
        print_json(done)
        return
    say(f"{done['id'][:12]}: {'added' if done['added'] else 'was there before; nothing changed'}")
    say(_counts(done["verdicts"]))
    if done["differing"]:
        warn(
            f"{done['differing']} verdicts of its sender are not what its files show: "
            f"`buildarena besiege evidence show {done['id'][:12]}` marks them"
        )


@app.command("list")
def list_evidence(*, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """List what evenings with the game showed, the newest first."""
    listed = Client(url).evidence()
    if as_json:
        print_json(listed)
        return
    rows = [
        (
            row["id"][:12],
            f"{row['game']}-{row['mod']}",
            row["made_at"][:10],
            _counts(row["verdicts"]),
        )
        for row in listed
    ]
    print_table(columns("id", "game and mod", "made", "verdicts"), rows)


@app.command("show")
def show_evidence(
    id_: Annotated[str, typer.Argument(metavar="ID", help="Its id, or the beginning.")],
    *,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Show one table of evidence: expected, seen, verdict, and how far engines agree."""
    shown = Client(url).evidence_table(id_)
    if as_json:
        print_json(shown)
        return
    rows = [
        (row["step"], row["assumption"], row["expected"], row["seen"], _verdict(row))
        for row in shown["table"]["rows"]
    ]
    heads = ("step", "assumption", "expected", "seen", "verdict")
    title = emphasised(f"Besiege {shown['game']}, mod {shown['mod']}")
    print_table(columns(*heads), rows, title=title)
    agreement = [
        (
            row["task"],
            f"{row['engine']} ({row['simulation_version']})",
            str(row["trials"]),
            f"{row['share']:.0%} ({row['low']:.0%} to {row['high']:.0%})",
        )
        for row in shown["table"]["agreement"]
    ]
    if agreement:
        print_table(columns("task", "engine", "runs", "same verdict"), agreement)


def _counts(verdicts: Mapping[str, int]) -> str:
    counts = verdicts.items()
    return ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in counts if count)


def _verdict(row: EvidenceRow) -> str:
    verdict = row["verdict"].replace("_", " ")
    if row["stated"] is None:
        return verdict
    return f"{verdict} (its sender: {row['stated'].replace('_', ' ')})"
