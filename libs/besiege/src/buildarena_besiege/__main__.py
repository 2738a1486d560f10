"""The command `python -m buildarena_besiege`."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from buildarena_besiege.any_file import read_any_machine
from buildarena_besiege.normal import normal_form
from buildarena_geometry import Machine


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command.

    Args:
        arguments: Its arguments; the process's own if left out.

    Returns:
        The exit code: 0 done, 1 the input is wrong, 2 wrong usage.
    """
    parser = argparse.ArgumentParser(prog="python -m buildarena_besiege")
    commands = parser.add_subparsers(dest="command", required=True)
    export = commands.add_parser("export", help="prints what a machine file would hold, as JSON")
    export.add_argument(
        "file", help="machine file (.bsg), machine document or action log; - reads standard input"
    )
    export.add_argument("--task", help="a task's name, or a task file; as built without")
    options = parser.parse_args(arguments)
    try:
        file = options.file
        data = sys.stdin.buffer.read() if file == "-" else Path(file).read_bytes()
        form = _form(read_any_machine(data, where=file).machine, options.task)
        print(json.dumps(form, allow_nan=False))  # noqa: T201  the command's output
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)  # noqa: T201  the command's message
        return 1
    return 0


def _form(machine: Machine, name: str | None) -> dict[str, Any]:
    if name is None:
        return normal_form(machine)
    # Tasks are in the benchmark, which this package does not import: only this command does.
    benchmark = import_module("buildarena_benchmark")
    known = benchmark.builtin_tasks()
    if name in known:
        task = known[name]
    elif Path(name).exists():
        task = benchmark.load_task(Path(name))
    else:
        raise ValueError(f"no task {name!r}; there are {', '.join(known)}, or name a task file")
    return normal_form(machine, task.scenario, category=task.category, level=task.level)


if __name__ == "__main__":
    sys.exit(main())
