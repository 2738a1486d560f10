"""The commands of jobs."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from buildarena_cli.client import Client, RefusedError, at
from buildarena_cli.commands.job_lists import list_jobs
from buildarena_cli.errors import DONE, FAILED, USAGE, CommandError, did_you_mean
from buildarena_cli.ids import resolve_id
from buildarena_cli.machines import film, read_machine, report_errors
from buildarena_cli.options import (
    DEFAULT_URL,
    JobId,
    JsonOption,
    ModelName,
    TaskName,
    TasksOption,
    TrackOption,
    UrlOption,
    new_group,
    to_read,
)
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
        typer.Option(help="YAML file of more fields: simulator, limits, …", callback=to_read),
    ] = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Submit one job; an equal one that exists is not repeated."""
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
    """Show a job: its settings, result and costs."""
    client = Client(url)
    _show(client.get(at("jobs", resolve_id(client, "job", job_id))), as_json=as_json)


@app.command("transcript")
@app.command("logs", hidden=True)
def job_transcript(
    job_id: JobId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False
) -> None:
    """Print a job's transcript as Markdown, or as JSON."""
    client = Client(url)
    path = at("jobs", resolve_id(client, "job", job_id), "transcript")
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


def _change(url: str, job_id: str, verb: str, *, as_json: bool) -> None:
    client = Client(url)
    path = at("jobs", resolve_id(client, "job", job_id), verb)
    _show(client.post(path, {}), as_json=as_json)


def _audit(job: dict[str, Any]) -> str:
    if job["verification_status"] == "verified":
        return f"verified at {minute_of(job['verified_at'])}"
    waits = "waits for its verification" if job["verification_status"] == "required" else "refuted"
    return f"{waits}: it counts nowhere"


def _say_trials(job: dict[str, Any]) -> None:
    if job.get("test_trials"):
        say(f"tests     {job['test_trials']} test trials used")
    if job.get("ran_on_runner"):
        say("trials    by a runner")


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
    worlds = job.get("worlds", ())
    for world in worlds if len(worlds) > 1 else ():
        passed = "passed" if world["success"] else "failed"
        say(f"world     {world['rollout']} {passed} {number(world['indicator'], 3)}")
    if job["flags"]:
        say(f"flags     {', '.join(job['flags'])}")
    say(f"indicator {number(job['indicator'], 3, at_least=job['censored'])}")
    _say_trials(job)
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
    for failure, times in job.get("retries", {}).items():
        say(f"retried   {times} x {failure}")
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
        list[str] | None, typer.Argument(help="Names of files; default: all.", metavar="[FILE]...")
    ] = None,
    *,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for the files; by default only list them.")
    ] = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """List a job's files, or download them into a folder and check their hashes."""
    client = Client(url)
    job_id = resolve_id(client, "job", job_id)
    files: list[dict[str, Any]] = _select(
        client.every(at("jobs", job_id, "artifacts")), names, job_id
    )
    if out is not None:
        for file in files:
            file["path"] = str(_fetched(client, job_id, file, out))
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
    """Return a safe file name, with the ending of its media type."""
    safe = re.sub(r"[^A-Za-z0-9._-]", "_", name).lstrip(".") or "file"
    ending = ENDINGS.get(media_type, "")
    return safe if safe.endswith(ending) else safe + ending


def _select(
    files: list[dict[str, Any]], names: list[str] | None, job_id: str
) -> list[dict[str, Any]]:
    by_name = {file["name"]: file for file in files}
    for name in names or ():
        if name not in by_name:
            raise CommandError(
                f"{job_id} has no file {name!r}; it has {', '.join(by_name) or 'none yet'}"
                f"{did_you_mean(name, by_name)}"
            )
    return [by_name[name] for name in names] if names else files


def _fetched(client: Client, job_id: str, file: dict[str, Any], folder: Path) -> Path:
    target = folder / file_name(file["name"], file["media_type"])
    path = at("jobs", job_id, "artifacts", file["name"])
    try:
        folder.mkdir(parents=True, exist_ok=True)
        client.download(path, target, sha256=file["sha256"])
    except OSError as error:
        raise CommandError(f"{target} can't be written: {error.strerror}") from error
    return target


VERDICTS: Final = {
    "verified": "Every figure is the same.",
    "refuted": "Some figures differ: the score counts nowhere.",
    "inconclusive": "It can't be said here: something is missing, damaged or of another version.",
}
"""What a verification comes to, for people."""


@app.command("verify")
def verify(
    job_id: Annotated[str | None, typer.Argument(help="The job.")] = None,
    *,
    model: Annotated[
        str | None,
        typer.Option("--model", help="All results of a model."),
    ] = None,
    sample: Annotated[
        int | None, typer.Option(help="With --model: how many results; default: all.")
    ] = None,
    seed: Annotated[int, typer.Option(help="With --model: seed of the random sample.")] = 0,
    task: TasksOption = None,
    track: TrackOption = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Replay finished jobs without a model, simulate them again and compare every figure.

    Give a job, or --model for a model's results. Every difference is shown, and makes the exit
    code 1.
    """
    if (job_id is None) == (model is None):
        raise CommandError("give a job, or --model", code=USAGE)
    client = Client(url)
    if job_id is not None:
        raise typer.Exit(_verify_job(client, job_id, as_json=as_json))
    body = {"model": model, "sample": sample, "seed": seed, "tasks": task, "track": track}
    raise typer.Exit(_verify_model(client, body, as_json=as_json))


def _verify_job(client: Client, job_id: str, *, as_json: bool) -> int:
    check = client.post(at("jobs", resolve_id(client, "job", job_id), "verify"), {})
    report: Any = client.wait_for_verification(check["id"])["report"]
    if as_json:
        print_json(report)
    else:
        for entry in report["checks"]:
            mark = "ok" if entry["ok"] else "!!"
            stored, computed = entry["kept"], entry["found"]
            shown = stored if entry["ok"] else f"kept {stored}, found {computed}"
            say(f"{mark}  {entry['name']:<32} {shown}")
        say(VERDICTS[report.get("verdict") or ("verified" if report["ok"] else "refuted")])
    return DONE if report["ok"] else FAILED


def _verify_model(client: Client, body: dict[str, Any], *, as_json: bool) -> int:
    differences: list[dict[str, Any]] = []
    accepted = client.post("/v1/leaderboard/verify", body)
    for id_ in _verifications(client, accepted):
        check: Any = client.wait_for_verification(id_)
        if not check["report"]["ok"]:
            wrong = [entry for entry in check["report"]["checks"] if not entry["ok"]]
            differences.append({"job_id": check["job_id"], "checks": wrong})
    checked = len(accepted["verification_ids"]) + len(accepted["skipped_job_ids"])
    if as_json:
        print_json({"scored": accepted["scored"], "checked": checked, "differences": differences})
    else:
        say(f"{checked} of {accepted['scored']} results checked")
        for difference in differences:
            for entry in difference["checks"]:
                say(
                    f"!!  {difference['job_id']} {entry['name']}: kept {entry['kept']}, "
                    f"found {entry['found']}"
                )
        if not differences:
            say("Every figure is the same.")
    return FAILED if differences else DONE


def _verifications(client: Client, accepted: dict[str, Any]) -> Iterator[str]:
    """Return the ids of all verifications, requesting skipped ones again when others have ended."""
    yield from accepted["verification_ids"]
    for job_id in accepted["skipped_job_ids"]:
        yield client.post(at("jobs", job_id, "verify"), {})["id"]


@app.command("replay")
def replay(
    job_id: JobId,
    *,
    out: Annotated[Path, typer.Option(help="The film (.mp4, .gif) or pictures (.png) to write.")],
    number: Annotated[int, typer.Option(help="Number of the job's rollout.", min=0)] = 0,
    url: UrlOption = DEFAULT_URL,
) -> None:
    """Draw a job's trial as a film."""
    import tempfile

    from buildarena_benchmark import parse_task
    from buildarena_simulation import read_trajectory

    client = Client(url)
    job_id = resolve_id(client, "job", job_id)
    job = client.get(at("jobs", job_id))
    task = client.get(at("tasks", job["task"]), version=job["task_version"])
    recorded = client.get_bytes(at("jobs", job_id, "trajectory"), number=number)
    document = client.get_bytes(at("jobs", job_id, "machine"))
    with report_errors(), tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "machine.json"
        file.write_bytes(document)
        rollout = read_trajectory(recorded)
        film(read_machine(file), parse_task(_text(task), origin=job["task"]), rollout, out)
    say(str(out))


def _text(task: dict[str, Any]) -> str:
    import yaml

    return yaml.safe_dump(task["document"])
