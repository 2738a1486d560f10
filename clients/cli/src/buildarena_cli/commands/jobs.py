"""The commands of jobs."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from buildarena_cli.commands.job_lists import list_jobs
from buildarena_cli.errors import DONE, FAILED, USAGE, CommandError, did_you_mean
from buildarena_cli.ids import path_of, resolve_id
from buildarena_cli.machines import film, report_errors
from buildarena_cli.options import (
    JobId,
    JsonOption,
    ModelName,
    ServiceOption,
    TaskName,
    TasksOption,
    TrackOption,
    new_group,
    printed_by,
)
from buildarena_cli.terminal.output import minute_of, number, print_line, print_rows
from buildarena_client.client import Client
from buildarena_client.paths import at

app = new_group("Submit and look at jobs.")
app.command("list")(list_jobs)


def _audit(job: dict[str, Any]) -> str:
    if job["verification_status"] == "verified":
        return f"verified at {minute_of(job['verified_at'])}"
    waits = "waits for its verification" if job["verification_status"] == "required" else "refuted"
    return f"{waits}: it counts nowhere"


def _show(job: dict[str, Any]) -> None:
    print_line(f"{job['id']}  {job['task']} x {job['model']} x seed {job['seed']}")
    print_line(f"track     {job['track']}")
    ended = job["outcome"] or f"{job['stage']} {job['state']}"
    print_line(f"outcome   {ended}" + (f" ({job['reason']})" if job["reason"] else ""))
    if job.get("explanation"):
        print_line(f"why       {job['explanation']}")
    worlds = job.get("worlds", ())
    for world in worlds if len(worlds) > 1 else ():
        passed = "passed" if world["success"] else "failed"
        print_line(f"world     {world['rollout']} {passed} {number(world['indicator'], 3)}")
    if job["flags"]:
        print_line(f"flags     {', '.join(job['flags'])}")
    print_line(f"indicator {number(job['indicator'], 3, at_least=job['censored'])}")
    if job.get("test_trials"):
        print_line(f"tests     {job['test_trials']} test trials used")
    if job.get("ran_on_runner"):
        print_line("trials    by a runner")
    if job["verification_status"]:
        print_line(f"audit     {_audit(job)}")
    usage = job["usage"]
    print_line(
        f"usage     {number(usage['requests'], 0)} requests, "
        f"{number(usage['input_tokens'], 0)} tokens in, "
        f"{number(usage['output_tokens'], 0)} out, ${number(usage['cost_usd'], 4)}"
    )
    share = f" ({job['refused_actions'] / job['actions']:.1%})" if job["actions"] else ""
    print_line(f"actions   {job['actions']}, {job['refused_actions']} refused{share}")
    for attempt in job.get("attempts", ()):
        print_line(
            f"attempt   {attempt['token']} {attempt['stage']} on {attempt['worker']}: "
            f"{attempt['result'] or 'running'}"
        )
    for failure, times in job.get("retries", {}).items():
        print_line(f"retried   {times} x {failure}")
    for name, digest in sorted(job.get("artifacts", {}).items()):
        print_line(f"file      {name}  {digest}")


@app.command("submit")
@printed_by(_show)
def submit_job(
    task: TaskName,
    model: ModelName,
    *,
    seed: Annotated[int, typer.Option(help="Seed or sample number.")] = 0,
    client: ServiceOption,
) -> Any:
    """Submit one job with default settings; an equal one that exists is not repeated."""
    return client.submit_job(task, model, seed=seed)


@app.command("show")
@printed_by(_show)
def show_job(job_id: JobId, *, client: ServiceOption) -> Any:
    """Show a job: its settings, result and costs."""
    return client.get(path_of(client, "job", job_id))


@app.command("transcript")
def job_transcript(job_id: JobId, *, client: ServiceOption, as_json: JsonOption = False) -> None:
    """Print a job's transcript as Markdown, or as JSON."""
    path = path_of(client, "job", job_id, "transcript")
    print_line(client.get_bytes(path, format="json" if as_json else "markdown").decode())


@app.command("cancel")
@printed_by(_show)
def cancel_job(job_id: JobId, *, client: ServiceOption) -> Any:
    """End a job that has not ended."""
    return client.post(path_of(client, "job", job_id, "cancel"))


@app.command("retry")
@printed_by(_show)
def retry_job(job_id: JobId, *, client: ServiceOption) -> Any:
    """Retry an errored job from its failed stage, or re-simulate one whose runner was refuted.

    A scored job is never run again.
    """
    return client.post(path_of(client, "job", job_id, "retry"))


ENDINGS = {
    "application/json": ".json",
    "application/vnd.apache.parquet": ".parquet",
    "image/png": ".png",
}
FILES = {
    "file": lambda file: file.get("path", file["name"]),
    "type": lambda file: file["media_type"],
    "bytes": lambda file: f"{file['size']:,}",
    "sha256": lambda file: file["sha256"],
}


@app.command("files")
@printed_by(lambda files: print_rows(FILES, files))
def job_files(
    job_id: JobId,
    names: Annotated[
        list[str] | None, typer.Argument(help="Names of files; default: all.", metavar="[FILE]...")
    ] = None,
    *,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for the files; by default only list them.")
    ] = None,
    client: ServiceOption,
) -> Any:
    """List a job's files, or download them into a folder and check their hashes."""
    job_id = resolve_id(client, "job", job_id)
    files = {file["name"]: file for file in client.every(at("jobs", job_id, "artifacts"))}
    for name in names or ():
        if name not in files:
            raise CommandError(
                f"{job_id} has no file {name!r}; it has {', '.join(files) or 'none yet'}"
                f"{did_you_mean(name, files)}"
            )
    chosen = [files[name] for name in names or files]
    if out is None:
        return chosen
    for file in chosen:
        target = Path(out, file_name(file["name"], file["media_type"]))
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            path = at("jobs", job_id, "artifacts", file["name"])
            client.download(path, target, sha256=file["sha256"])
        except OSError as error:
            raise CommandError(f"{target} can't be written: {error.strerror}") from error
        file["path"] = str(target)
    return chosen


def file_name(name: str, media_type: str) -> str:
    """Return a safe file name, with the ending of its media type."""
    safe = re.sub(r"[^A-Za-z0-9._-]", "_", name).lstrip(".") or "file"
    ending = ENDINGS.get(media_type, "")
    return safe if safe.endswith(ending) else safe + ending


VERDICTS: Final = {
    "refuted": "Some figures differ: the score counts nowhere.",
    "inconclusive": "It can't be said here: something is missing, damaged or of another version.",
}
"""What a verification that found differences comes to, for people."""


def _show_verifications(answer: dict[str, Any]) -> None:
    print_line(f"{answer['checked']} results checked")
    for report in answer["differences"]:
        for entry in report["checks"]:
            print_line(
                f"!!  {report['job_id']} {entry['name']}: kept {entry['kept']}, "
                f"found {entry['found']}"
            )
        print_line(VERDICTS[report["verdict"]])
    if not answer["differences"]:
        print_line("Every figure is the same.")


@app.command("verify")
@printed_by(_show_verifications, code=lambda answer: FAILED if answer["differences"] else DONE)
def verify(
    job_id: Annotated[str | None, typer.Argument(help="The job.")] = None,
    *,
    model: Annotated[str | None, typer.Option("--model", help="All results of a model.")] = None,
    sample: Annotated[
        int | None, typer.Option(help="With --model: how many results, at random; default: all.")
    ] = None,
    task: TasksOption = None,
    track: TrackOption = None,
    client: ServiceOption,
) -> Any:
    """Replay finished jobs without a model, simulate them again and compare every figure.

    Give a job, or --model for a model's results. Every difference is shown, and makes the exit
    code 1.
    """
    if (job_id is None) == (model is None):
        raise CommandError("give a job, or --model", code=USAGE)
    if job_id is not None:
        jobs: dict[str, Any] = {
            "verification_ids": [],
            "skipped_job_ids": [resolve_id(client, "job", job_id)],
        }
    else:
        body = {"model": model, "sample": sample, "tasks": task, "track": track}
        jobs = client.post("/v1/leaderboard/verify", body)
    checked, differences = 0, []
    for id_ in _verifications(client, jobs):
        check: Any = client.wait_for_verification(id_)
        checked += 1
        wrong = [entry for entry in check["report"]["checks"] if not entry["ok"]]
        if wrong:
            verdict = check["report"]["verdict"]
            differences.append({"job_id": check["job_id"], "verdict": verdict, "checks": wrong})
    return {"checked": checked, "differences": differences}


def _verifications(client: Client, jobs: dict[str, Any]) -> Iterator[str]:
    """Yield the ids of all verifications, requesting skipped ones when others have ended."""
    yield from jobs["verification_ids"]
    for job_id in jobs["skipped_job_ids"]:
        yield client.verify_job(job_id)["id"]


@app.command("replay")
def replay(
    job_id: JobId,
    *,
    out: Annotated[Path, typer.Option(help="The film (.mp4, .gif) or pictures (.png) to write.")],
    client: ServiceOption,
) -> None:
    """Draw the trial that determined a job's score as a film."""
    from buildarena.service import job_trial

    trial = job_trial(resolve_id(client, "job", job_id), client.url)
    if trial.trajectory is not None:
        with report_errors():
            film(trial.machine, trial.task, trial.trajectory, out)
        print_line(str(out))
