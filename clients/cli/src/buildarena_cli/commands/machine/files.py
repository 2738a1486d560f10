"""`buildarena machine check` and `export`: machines as files and pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from buildarena_cli.errors import DONE, FAILED, CommandError
from buildarena_cli.machines import (
    ControllerOption,
    KeysOption,
    MachineFile,
    read_machine,
    report_errors,
    resolve_task,
)
from buildarena_cli.options import printed_by
from buildarena_cli.terminal.output import print_line

if TYPE_CHECKING:
    from buildarena_geometry import Machine

FORMATS = (".glb", ".svg", ".json", ".bsg")


def _show(report: dict[str, Any]) -> None:
    size = " x ".join(f"{length:.2f}" for length in report["size"])
    print_line(f"{report['parts']} parts, mass {report['mass']:.2f}, cost {report['cost']}")
    print_line(f"{size} units east x north x up")
    for problem in report["problems"] or ["The machine is sound."]:
        print_line(problem)


@printed_by(_show, code=lambda report: FAILED if report["problems"] else DONE)
@report_errors()
def check(
    file: MachineFile,
    task: Annotated[
        str | None, typer.Option("--task", help="Also compare with this task's constraints.")
    ] = None,
) -> Any:
    """Check a machine and list its parts; exit code 1 when it is invalid."""
    from buildarena_benchmark import broken_constraint

    machine = read_machine(file)
    broken = None if task is None else broken_constraint(resolve_task(task), machine)
    problems = [f"block {block} is attached to nothing" for block in machine.detached]
    if broken is not None and not (problems and broken[0] == "unjoined_parts"):
        problems.append(f"{broken[0]}: {broken[1]}")
    low, high = machine.bounds
    return {
        "parts": machine.part_count,
        "mass": machine.mass,
        "cost": machine.cost,
        "size": [round(float(length), 3) for length in high - low],
        "problems": problems,
    }


@report_errors()
def export(
    file: MachineFile,
    out: Annotated[Path, typer.Option(help=f"File to write: {', '.join(FORMATS)}.")],
    task: Annotated[
        str | None, typer.Option("--task", help="For a .bsg: prepare it for this task's trial.")
    ] = None,
    keys: KeysOption = None,
    *,
    controller: ControllerOption = None,
) -> None:
    """Write a machine as a 3D model, a drawing, a machine document or the game's file.

    With a task, the game's file (.bsg) runs that task's trial: it places the machine with its
    cargo, plays its keys or its program, and logs its motion. Without, it is only the machine.
    """
    from buildarena_geometry.export import machine_glb, machine_svg
    from buildarena_geometry.machine_files import machine_bytes

    if out.suffix not in FORMATS:
        raise CommandError(f"{out}: {out.suffix or 'no'} ending; use {', '.join(FORMATS)}")
    options = {"--task": task, "--key-presses": keys, "--controller": controller}
    for option, value in options.items():
        if value is not None and out.suffix != ".bsg":
            raise CommandError(f"{option} is for .bsg files, not for {out}")
    machine = read_machine(file, controller)
    if out.suffix == ".glb":
        content = machine_glb(machine)
    elif out.suffix == ".svg":
        content = machine_svg(machine).encode()
    elif out.suffix == ".json":
        content = machine_bytes(machine)
    else:
        content = _game_file(machine, out.stem, task, keys)
    out.write_bytes(content)
    print_line(str(out))


def _game_file(machine: Machine, name: str, task: str | None, keys: Path | None) -> bytes:
    import uuid

    from buildarena_besiege import plain_machine_file, prepare_run, read_presses

    presses = None if keys is None else read_presses(keys.read_bytes(), where=str(keys))
    if task is None:
        return plain_machine_file(machine, name=name, controls=presses)
    scenario, run_id = resolve_task(task).scenario, uuid.uuid4().hex
    return prepare_run(machine, scenario, name=name, run_id=run_id, controls=presses).machine_file
