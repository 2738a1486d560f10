"""`buildarena job files`: a job's artifacts, listed and fetched."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any

import typer

from buildarena_cli.client import Client, at
from buildarena_cli.errors import CommandError
from buildarena_cli.ids import whole_id
from buildarena_cli.options import DEFAULT_URL, JobId, JsonOption, UrlOption
from buildarena_cli.suggestions import did_you_mean
from buildarena_cli.terminal.output import print_json, print_table, say

ENDINGS = {
    "application/json": ".json",
    "application/vnd.apache.parquet": ".parquet",
    "image/png": ".png",
}


def job_files(
    job_id: JobId,
    names: Annotated[
        list[str] | None, typer.Argument(help="Which files; default: all.", metavar="[FILE]...")
    ] = None,
    *,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder to write them into; listed only without.")
    ] = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """List a job's files, or fetch them into a folder and check them against their hashes."""
    client = Client(url)
    whole = whole_id(client, "job", job_id)
    files: list[dict[str, Any]] = _chosen(
        client.every(at("jobs", whole, "artifacts")), names, whole
    )
    if out is not None:
        for file in files:
            file["path"] = str(_fetched(client, whole, file, out))
    if as_json:
        print_json(files)
    elif out is not None:
        for file in files:
            say(f"{file['path']}: {file['size']:,} bytes")
    else:
        print_table(
            ("file", "type", "bytes", "sha256"),
            [(f["name"], f["media_type"], f"{f['size']:,}", f["sha256"]) for f in files],
            numeric=("bytes",),
        )


def file_name(name: str, media_type: str) -> str:
    """A name that stays in the folder, with the ending of its media type."""
    safe = re.sub(r"[^A-Za-z0-9._-]", "_", name).lstrip(".") or "file"
    ending = ENDINGS.get(media_type, "")
    return safe if safe.endswith(ending) else safe + ending


def _chosen(
    files: list[dict[str, Any]], names: list[str] | None, job_id: str
) -> list[dict[str, Any]]:
    known = {file["name"]: file for file in files}
    for name in names or ():
        if name not in known:
            raise CommandError(
                f"{job_id} has no file {name!r}; it has {', '.join(known) or 'none yet'}"
                f"{did_you_mean(name, known)}"
            )
    return [known[name] for name in names] if names else files


def _fetched(client: Client, job_id: str, file: dict[str, Any], folder: Path) -> Path:
    target = folder / file_name(file["name"], file["media_type"])
    path = at("jobs", job_id, "artifacts", file["name"])
    try:
        folder.mkdir(parents=True, exist_ok=True)
        client.download(path, target, sha256=file["sha256"])
    except OSError as error:
        raise CommandError(f"{target} can't be written: {error.strerror}") from error
    return target
