"""`buildarena machine check` and `export`, and `job replay`: machines as files and pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from buildarena_cli.client import Client, at
from buildarena_cli.errors import DONE, FAILED, CommandError
from buildarena_cli.ids import whole_id
from buildarena_cli.machines import (
    MachineFile,
    chosen_task,
    film,
    read_machine,
    shown_errors,
)
from buildarena_cli.options import DEFAULT_URL, JobId, JsonOption, UrlOption
from buildarena_cli.terminal.output import print_json, say

if TYPE_CHECKING:
    from buildarena_geometry import Machine

FORMATS = (".glb", ".svg", ".json")


def check(
    file: MachineFile,
    task: Annotated[
        str | None, typer.Option("--task", help="Also compare with this task's constraints.")
    ] = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Check whether a machine is sound and what it is made of; exit code 1 when it is not."""
    from buildarena_benchmark import broken_constraint

    with shown_errors():
        machine = read_machine(file)
        chosen = None if task is None else chosen_task(task)
        broken = None if chosen is None else broken_constraint(chosen, machine)
        problems = [f"block {block} is attached to nothing" for block in machine.detached]
        if broken is not None and not (problems and broken[0] == "unjoined_parts"):
            problems.append(f"{broken[0]}: {broken[1]}")
        found = {**_facts(machine), "problems": problems}
        if as_json:
            print_json(found)
        else:
            _print_facts(found)
        raise typer.Exit(FAILED if problems else DONE)


def _facts(machine: Machine) -> dict[str, Any]:
    low, high = machine.bounds
    return {
        "parts": machine.part_count,
        "mass": machine.mass,
        "cost": machine.cost,
        "size": [round(float(length), 3) for length in high - low],
    }


def _print_facts(found: dict[str, Any]) -> None:
    size = " x ".join(f"{length:.2f}" for length in found["size"])
    say(f"{found['parts']} parts, mass {found['mass']:.2f}, cost {found['cost']}")
    say(f"{size} units east x north x up")
    for problem in found["problems"]:
        say(problem)
    if not found["problems"]:
        say("The machine is sound.")


def export(
    file: MachineFile,
    out: Annotated[Path, typer.Option(help=f"File to write: {', '.join(FORMATS)}.")],
) -> None:
    """Write a machine as a 3D model (.glb), a drawing (.svg) or a machine document (.json)."""
    from buildarena_geometry.export import machine_glb, machine_svg

    with shown_errors():
        machine = read_machine(file)
        if out.suffix == ".glb":
            out.write_bytes(machine_glb(machine))
        elif out.suffix == ".svg":
            out.write_text(machine_svg(machine), encoding="utf-8")
        elif out.suffix == ".json":
            from buildarena_pipeline.runtime.machine_documents import machine_bytes

            out.write_bytes(machine_bytes(machine))
        else:
            raise CommandError(f"{out}: {out.suffix or 'no'} ending; use {', '.join(FORMATS)}")
    say(str(out))


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
