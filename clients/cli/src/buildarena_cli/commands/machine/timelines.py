"""`buildarena machine control`: timelines of channels, `buildarena.control_timeline.v2`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from buildarena_cli.errors import CommandError
from buildarena_cli.given_paths import to_read
from buildarena_cli.lazy import new_group
from buildarena_cli.machines import (
    DialectOption,
    MachineFile,
    controlled,
    read_machine,
    shown_errors,
)
from buildarena_cli.terminal.output import say, warn

if TYPE_CHECKING:
    from buildarena_geometry import Machine

app = new_group("Read and write timelines of what a machine's blocks do.")

OutOption = Annotated[Path, typer.Option(help="File to write (.json).")]


@app.command("import")
def import_timeline(
    file: Annotated[
        Path, typer.Argument(help="A timeline of schema v2 (.json).", callback=to_read)
    ],
    machine: Annotated[Path, typer.Option(help="The machine that it is for.", callback=to_read)],
    out: OutOption,
    dialect: DialectOption = None,
) -> None:
    """Write a machine document whose keys do what a timeline says.

    Blocks are numbered from 1 as in the machine's file of the game. A channel is on while its value
    is above 0.5: keys know no shares. Other keys, key presses and a program of the machine go.
    """
    from buildarena_besiege import machine_with_timeline

    with shown_errors():
        timed = machine_with_timeline(
            read_machine(machine, dialect), file.read_bytes(), where=str(file)
        )
        if timed.shares:
            warn(
                f"{file}: {timed.shares} events have a value between 0 and 1: on above 0.5, "
                "otherwise off"
            )
        _write_machine(timed.machine, out)
    say(str(out))


@app.command("export")
def export_timeline(
    file: MachineFile,
    out: OutOption,
    controller: Annotated[
        Path | None,
        typer.Option(help="A program (.lua) in place of what the machine has.", callback=to_read),
    ] = None,
    seconds: Annotated[
        float, typer.Option(help="For how long a program is asked.", min=0.04, max=600.0)
    ] = 30.0,
    dialect: DialectOption = None,
) -> None:
    """Write what a machine does as a timeline: its key presses, or a program that reads no sense.

    A program is asked every 0.04 s; one that reads a sense is refused, with the line that does.
    """
    from buildarena_besiege import timeline_of

    with shown_errors():
        machine = read_machine(file, dialect)
        if controller is not None:
            machine = controlled(machine, controller)
        out.write_bytes(timeline_of(machine, seconds=seconds))
    say(str(out))


def _write_machine(machine: Machine, out: Path) -> None:
    from buildarena_geometry.machine_files import machine_bytes

    if out.suffix != ".json":
        raise CommandError(f"{out}: {out.suffix or 'no'} ending; use .json")
    out.write_bytes(machine_bytes(machine))
