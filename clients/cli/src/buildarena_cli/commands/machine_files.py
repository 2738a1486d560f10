"""`buildarena machine check` and `export`, and `job replay`: machines as files and pictures."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated, Any

import typer

from buildarena_benchmark import broken_constraint, parse_task
from buildarena_cli.client import Client
from buildarena_cli.commands.machine import (
    MachineFile,
    chosen_task,
    film,
    read_machine,
    told_errors,
)
from buildarena_cli.errors import DONE, FAILED, CommandError
from buildarena_cli.options import DEFAULT_URL, JsonOption, UrlOption
from buildarena_cli.output import console, print_json
from buildarena_geometry import Machine
from buildarena_geometry.export import machine_glb, machine_svg
from buildarena_simulation import read_trajectory

FORMATS = (".glb", ".svg", ".json")


def check(
    file: MachineFile,
    task: Annotated[
        str | None, typer.Option("--task", help="Also compare with this task's constraints.")
    ] = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Tell whether a machine is sound and what it is made of; exit code 1 when it is not."""
    with told_errors():
        machine = read_machine(file)
        chosen = None if task is None else chosen_task(task)
        broken = None if chosen is None else broken_constraint(chosen, machine)
        problems = [f"block {block} is attached to nothing" for block in machine.detached]
        problems += [] if broken is None else [f"{broken[0]}: {broken[1]}"]
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
    console.print(f"{found['parts']} parts, mass {found['mass']:.2f}, cost {found['cost']}")
    console.print(f"{size} units east x north x up")
    for problem in found["problems"]:
        console.print(problem, markup=False, soft_wrap=True)
    if not found["problems"]:
        console.print("The machine is sound.")


def export(
    file: MachineFile,
    out: Annotated[Path, typer.Option(help=f"File to write: {', '.join(FORMATS)}.")],
) -> None:
    """Write a machine as a 3D model (.glb), a drawing (.svg) or a machine document (.json)."""
    with told_errors():
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
    console.print(str(out), soft_wrap=True)


def replay(
    job_id: Annotated[str, typer.Argument(help="Id of the job.")],
    *,
    out: Annotated[Path, typer.Option(help="The film (.mp4, .gif) or pictures (.png) to write.")],
    number: Annotated[int, typer.Option(help="Which of the job's rollouts.", min=0)] = 0,
    url: UrlOption = DEFAULT_URL,
) -> None:
    """Draw a job's trial as a film."""
    client = Client(url)
    job = client.get(f"/v1/jobs/{job_id}")
    task = client.get(f"/v1/tasks/{job['task']}", version=job["task_version"])
    recorded = client.get_bytes(f"/v1/jobs/{job_id}/trajectory", number=number)
    document = client.get_bytes(f"/v1/jobs/{job_id}/machine")
    with told_errors(), tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "machine.json"
        file.write_bytes(document)
        rollout = read_trajectory(recorded)
        film(read_machine(file), parse_task(_text(task), origin=job["task"]), rollout, out)
    console.print(str(out), soft_wrap=True)


def _text(task: dict[str, Any]) -> str:
    import yaml

    return yaml.safe_dump(task["document"])
