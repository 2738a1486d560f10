"""Import of logs into a service: `python -m buildarena_inspect import LOG…`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

from buildarena_client import Client, ClientError
from buildarena_inspect.errors import BuildarenaInspectError
from buildarena_inspect.importing import Imported, import_sample
from buildarena_inspect.logs import Unusable, logged_samples, state_of


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return 1 if a sample was skipped or differs from its log."""
    parser = argparse.ArgumentParser(prog="python -m buildarena_inspect", description=__doc__)
    commands = parser.add_subparsers(required=True)
    command = commands.add_parser("import", help="repeat the calls of logs in a service")
    command.add_argument("logs", nargs="+", type=Path, metavar="LOG")
    command.add_argument("--url", help="the service; by default BUILDARENA_URL, or this machine's")
    command.add_argument("--agent", help="name behind `inspect-`; the model's by default")
    command.add_argument("--limit", type=int, help="maximum number of samples of each log")
    command.add_argument("--wait", type=float, default=600.0, help="seconds for a job to end")
    try:
        return _import(parser.parse_args(arguments))
    except (BuildarenaInspectError, ClientError) as error:
        sys.stderr.write(f"{error}\n")
        return 2


def _import(options: argparse.Namespace) -> int:
    clean = True
    seen: set[str] = set()  # a merged log, its shards and a retry have samples in common
    with Client(options.url) as service:
        for path in _files(options.logs):
            is_complete, progress = state_of(path)
            clean &= is_complete
            _say(progress)
            for sample in islice(logged_samples(path), options.limit):
                result: Imported | Unusable
                if isinstance(sample, Unusable):
                    result = sample
                elif sample.uuid in seen:
                    continue
                else:
                    seen.add(sample.uuid)
                    result = import_sample(
                        sample, service, agent=options.agent, within_s=options.wait
                    )
                clean &= _print_result(result)
    return 0 if clean else 1


def _print_result(result: Imported | Unusable) -> bool:
    """Print the result of a sample; return whether it is a job that agrees with its log."""
    about = f"{result.sample} epoch {result.epoch}"
    if isinstance(result, Unusable):
        _say(f"{about}: left out: {result.reason}")
        return False
    note = ", imported before" if result.existed else ""
    outcome = result.outcome or "has not ended yet"
    _say(f"{about}: {result.job} by agent/{result.agent}{note}: {outcome}")
    for difference in result.differences:
        _say(f"  {difference}")
    return result.outcome is not None and not result.differences


def _files(places: Sequence[Path]) -> list[Path]:
    """Return the named logs, and those in named folders and below them, shards included."""
    logs: list[Path] = []
    for place in places:
        logs += sorted(place.rglob("*.eval")) if place.is_dir() else [place]
    return logs


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")


if __name__ == "__main__":
    sys.exit(main())
