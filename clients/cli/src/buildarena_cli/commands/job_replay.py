"""`buildarena job replay`: a job's trial as a film."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from buildarena_cli.client import Client, at
from buildarena_cli.ids import whole_id
from buildarena_cli.machines import film, read_machine, shown_errors
from buildarena_cli.options import DEFAULT_URL, JobId, UrlOption
from buildarena_cli.terminal.output import say


def replay(
    job_id: JobId,
    *,
    out: Annotated[Path, typer.Option(help="The film (.mp4, .gif) or pictures (.png) to write.")],
    number: Annotated[int, typer.Option(help="Which of the job's rollouts.", min=0)] = 0,
    url: UrlOption = DEFAULT_URL,
) -> None:
    """Draw a job's trial as a film."""
    import tempfile

    from buildarena_benchmark import parse_task
    from buildarena_simulation import read_trajectory

    client = Client(url)
    whole = whole_id(client, "job", job_id)
    job = client.get(at("jobs", whole))
    task = client.get(at("tasks", job["task"]), version=job["task_version"])
    recorded = client.get_bytes(at("jobs", whole, "trajectory"), number=number)
    document = client.get_bytes(at("jobs", whole, "machine"))
    with shown_errors(), tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "machine.json"
        file.write_bytes(document)
        rollout = read_trajectory(recorded)
        film(read_machine(file), parse_task(_text(task), origin=job["task"]), rollout, out)
    say(str(out))


def _text(task: dict[str, Any]) -> str:
    import yaml

    return yaml.safe_dump(task["document"])
