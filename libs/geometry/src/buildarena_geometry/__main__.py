"""The command `python -m buildarena_geometry`."""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from buildarena_geometry.dialects import dialect, dialects
from buildarena_geometry.errors import GeometryError
from buildarena_geometry.vectors.sequences import parse, run_sequences


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Args:
        arguments: command line without the program's name. Defaults to the process's.

    Returns:
        The exit code: 0 done, 1 the input is not a sequence, 2 wrong usage.
    """
    parser = argparse.ArgumentParser(prog="python -m buildarena_geometry")
    commands = parser.add_subparsers(dest="command", required=True)
    replay = commands.add_parser("replay", help="builds machines from action sequences")
    replay.add_argument("file", help="JSON, plain or gzip; - reads standard input")
    replay.add_argument("--states", choices=("all", "last"), default="all")
    about = "the interface whose names and labels the sequences use"
    replay.add_argument("--dialect", choices=tuple(dialects()), default="1.0", help=about)
    options = parser.parse_args(arguments)
    try:
        data = sys.stdin.buffer.read() if options.file == "-" else Path(options.file).read_bytes()
        speaking, every_state = dialect(options.dialect), options.states == "all"
        for result in run_sequences(parse(data), every_state=every_state, speaking=speaking):
            print(json.dumps(result, allow_nan=False))  # noqa: T201  the command's output
    except (GeometryError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)  # noqa: T201  the command's message
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
