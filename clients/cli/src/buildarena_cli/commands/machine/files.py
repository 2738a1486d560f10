"""`buildarena machine check` and `export`: machines as files and pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from buildarena_cli.errors import DONE, FAILED, CommandError
from buildarena_cli.machines import (
    DialectOption,
    MachineFile,
    controlled,
    read_machine,
    report_errors,
    resolve_task,
)
from buildarena_cli.options import JsonOption, to_read
from buildarena_cli.terminal.output import print_json, say

if TYPE_CHECKING:
    from buildarena_geometry import Machine

FORMATS = (".glb", ".svg", ".json", ".bsg")


def check(
    file: MachineFile,
    task: Annotated[
        str | None, typer.Option("--task", help="Also compare with this task's constraints.")
    ] = None,
    dialect: DialectOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Check a machine and list its parts; exit code 1 when it is invalid."""
    from buildarena_benchmark import broken_constraint

    with report_errors():
        machine = read_machine(file, dialect)
        chosen = None if task is None else resolve_task(task)
        broken = None if chosen is None else broken_constraint(chosen, machine)
        problems = [f"block {block} is attached to nothing" for block in machine.detached]
        if broken is not None and not (problems and broken[0] == "unjoined_parts"):
            problems.append(f"{broken[0]}: {broken[1]}")
        report = {**_facts(machine), "problems": problems}
        if as_json:
            print_json(report)
        else:
            _print_facts(report)
        raise typer.Exit(FAILED if problems else DONE)


def _facts(machine: Machine) -> dict[str, Any]:
    low, high = machine.bounds
    return {
        "parts": machine.part_count,
        "mass": machine.mass,
        "cost": machine.cost,
        "size": [round(float(length), 3) for length in high - low],
    }


def _print_facts(facts: dict[str, Any]) -> None:
    size = " x ".join(f"{length:.2f}" for length in facts["size"])
    say(f"{facts['parts']} parts, mass {facts['mass']:.2f}, cost {facts['cost']}")
    say(f"{size} units east x north x up")
    for problem in facts["problems"]:
        say(problem)
    if not facts["problems"]:
        say("The machine is sound.")


def export(
    file: MachineFile,
    out: Annotated[Path, typer.Option(help=f"File to write: {', '.join(FORMATS)}.")],
    task: Annotated[
        str | None, typer.Option("--task", help="For a .bsg: prepare it for this task's trial.")
    ] = None,
    controls: Annotated[
        Path | None,
        typer.Option(
            "--key-presses",
            help="For a .bsg: play these key presses (JSON list of time, key, hold_for) instead "
            "of the machine's own.",
            callback=to_read,
        ),
    ] = None,
    *,
    controller: Annotated[
        Path | None,
        typer.Option(
            help="For a .bsg: a program (.lua) in place of the machine's own.", callback=to_read
        ),
    ] = None,
    dialect: DialectOption = None,
) -> None:
    """Write a machine as a 3D model, a drawing, a machine document or the game's file.

    With a task, the game's file (.bsg) runs that task's trial: it places the machine with its
    cargo, plays its keys or its program, and logs its motion. Without, it is only the machine.
    """
    from buildarena_geometry.export import machine_glb, machine_svg

    with report_errors():
        if out.suffix not in FORMATS:
            raise CommandError(f"{out}: {out.suffix or 'no'} ending; use {', '.join(FORMATS)}")
        options = {"--task": task, "--key-presses": controls, "--controller": controller}
        for option, value in options.items():
            if value is not None and out.suffix != ".bsg":
                raise CommandError(f"{option} is for .bsg files, not for {out}")
        machine = read_machine(file, dialect)
        if controller is not None:
            machine = controlled(machine, controller)
        if out.suffix == ".glb":
            out.write_bytes(machine_glb(machine))
        elif out.suffix == ".svg":
            out.write_text(machine_svg(machine), encoding="utf-8")
        elif out.suffix == ".json":
            from buildarena_geometry.machine_files import machine_bytes

            out.write_bytes(machine_bytes(machine))
        else:
            out.write_bytes(_game_file(machine, out.stem, task, controls))
    say(str(out))


def _game_file(machine: Machine, name: str, task: str | None, controls: Path | None) -> bytes:
    import uuid

    from buildarena_besiege import plain_machine_file, prepare_run, read_presses

    presses = None if controls is None else read_presses(controls.read_bytes(), where=str(controls))
    if task is None:
        return plain_machine_file(machine, name=name, controls=presses)
    scenario = resolve_task(task).scenario
    run_id = uuid.uuid4().hex
    run = prepare_run(machine, scenario, name=name, run_id=run_id, controls=presses)
    return run.machine_file
