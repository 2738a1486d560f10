"""The commands of jobs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any

import typer

from buildarena_cli.client import Client, RefusedError, at
from buildarena_cli.commands.job_lists import list_jobs
from buildarena_cli.commands.job_replay import replay
from buildarena_cli.commands.job_verify import verify
from buildarena_cli.errors import CommandError
from buildarena_cli.given_paths import to_read
from buildarena_cli.groups import new_group
from buildarena_cli.ids import whole_id
from buildarena_cli.options import DEFAULT_URL, JobId, JsonOption, ModelName, TaskName, UrlOption
from buildarena_cli.suggestions import did_you_mean
from buildarena_cli.terminal.output import minute_of, number, print_json, print_table, say

app = new_group("Submit and look at jobs.")
app.command("list")(list_jobs)


@app.command("submit")
def submit_job(
    task: TaskName,
    model: ModelName,
    *,
    seed: Annotated[int, typer.Option(help="Seed or sample number.")] = 0,
    options: Annotated[
        Path | None,
        typer.Option(help="YAML file of further fields: simulator, limits, …", callback=to_read),
    ] = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Submit one job; an equal one that exists is never done again."""
    body = {"task": task, "model": model, "seed": seed}
    if options is None:
        _show(Client(url).post("/v1/jobs", body), as_json=as_json)
        return
    from buildarena_cli.sweep_files import read_fields

    more = read_fields(options).with_words(body)
    try:
        _show(Client(url).post("/v1/jobs", more.content), as_json=as_json)
    except RefusedError as error:
        raise more.refused(error) from error


@app.command("show")
def show_job(job_id: JobId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """Show a job: what it is, how it ended, what it used."""
    client = Client(url)
    _show(client.get(at("jobs", whole_id(client, "job", job_id))), as_json=as_json)


@app.command("transcript")
@app.command("logs", hidden=True)
def job_transcript(
    job_id: JobId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False
) -> None:
    """Print a job's transcript as Markdown, or as JSON."""
    client = Client(url)
    path = at("jobs", whole_id(client, "job", job_id), "transcript")
    say(client.get_bytes(path, format="json" if as_json else "markdown").decode())


@app.command("cancel")
def cancel_job(job_id: JobId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """End a job that has not ended."""
    _change(url, job_id, "cancel", as_json=as_json)


@app.command("retry")
def retry_job(job_id: JobId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """Retry an errored job from its failed stage, or re-simulate one whose runner was refuted.

    A scored job is never run again.
    """
    _change(url, job_id, "retry", as_json=as_json)


app.command("verify")(verify)
app.command("replay")(replay)


def _change(url: str, job_id: str, verb: str, *, as_json: bool) -> None:
    client = Client(url)
    path = at("jobs", whole_id(client, "job", job_id), verb)
    _show(client.post(path, {}), as_json=as_json)


def _audit(job: dict[str, Any]) -> str:
    if job["verification_status"] == "verified":
        return f"verified at {minute_of(job['verified_at'])}"
    waits = "waits for its verification" if job["verification_status"] == "required" else "refuted"
    return f"{waits}: it counts nowhere"


def _show(job: dict[str, Any], *, as_json: bool) -> None:
    if as_json:
        print_json(job)
        return
    say(f"{job['id']}  {job['task']} x {job['model']} x seed {job['seed']}")
    say(f"track     {job['track']}")
    ended = job["outcome"] or f"{job['stage']} {job['state']}"
    say(f"outcome   {ended}" + (f" ({job['reason']})" if job["reason"] else ""))
    if job.get("explanation"):
        say(f"why       {job['explanation']}")
    if job["flags"]:
        say(f"flags     {', '.join(job['flags'])}")
    say(f"indicator {number(job['indicator'], 3, at_least=job['censored'])}")
    if job.get("by_runner"):
        say("trials    by a runner")
    if job["verification_status"]:
        say(f"audit     {_audit(job)}")
    usage = job["usage"]
    say(
        f"usage     {number(usage['requests'], 0)} requests, "
        f"{number(usage['input_tokens'], 0)} tokens in, "
        f"{number(usage['output_tokens'], 0)} out, ${number(usage['cost_usd'], 4)}"
    )
    share = f" ({job['refused_actions'] / job['actions']:.1%})" if job["actions"] else ""
    say(f"actions   {job['actions']}, {job['refused_actions']} refused{share}")
    for attempt in job.get("attempts", ()):
        say(
            f"attempt   {attempt['token']} {attempt['stage']} on {attempt['worker']}: "
            f"{attempt['result'] or 'running'}"
        )
    for name, digest in sorted(job.get("artifacts", {}).items()):
        say(f"file      {name}  {digest}")


ENDINGS = {
    "application/json": ".json",
    "application/vnd.apache.parquet": ".parquet",
    "image/png": ".png",
}


@app.command("files")
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
