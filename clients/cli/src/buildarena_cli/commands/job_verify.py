"""The command ``buildarena job verify``: of one job, or of a model's results."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Final

import typer

from buildarena_cli.client import Client, at
from buildarena_cli.errors import DONE, FAILED, USAGE, CommandError
from buildarena_cli.ids import whole_id
from buildarena_cli.options import DEFAULT_URL, JsonOption, TasksOption, TrackOption, UrlOption
from buildarena_cli.terminal.output import print_json, say

VERDICTS: Final = {
    "verified": "Every figure is the same.",
    "refuted": "Some figures differ: the score counts nowhere.",
    "inconclusive": "It can't be said here: something is missing, damaged or of another version.",
}
"""What a verification comes to, for people."""


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
    check = client.post(at("jobs", whole_id(client, "job", job_id), "verify"), {})
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
    """Ids of all verifications; those that found no room are asked for when others have ended."""
    yield from accepted["verification_ids"]
    for job_id in accepted["skipped_job_ids"]:
        yield client.post(at("jobs", job_id, "verify"), {})["id"]
