"""Brings logs into a service: `python -m buildarena_inspect import LOG…`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

from buildarena_client import Client, ClientError
from buildarena_inspect.errors import BuildarenaInspectError
from buildarena_inspect.importing import Imported, bring
from buildarena_inspect.logs import Unusable, logged_samples, state_of


def main(arguments: Sequence[str] | None = None) -> int:
    """Carries out the command; 1 when something was left out or is not as the log says."""
    given = _parser().parse_args(arguments)
    try:
        return int(given.command(given))
    except (BuildarenaInspectError, ClientError) as error:
        sys.stderr.write(f"{error}\n")
        return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m buildarena_inspect", description=__doc__)
    commands = parser.add_subparsers(required=True)
    one = commands.add_parser("import", help="make the calls of logs again in a service")
    one.add_argument("logs", nargs="+", type=Path, metavar="LOG")
    one.add_argument("--url", help="the service; by default BUILDARENA_URL, or this machine's")
    one.add_argument("--agent", help="name behind `inspect-`; the model's by default")
    one.add_argument("--limit", type=int, help="only so many samples of each log")
    one.add_argument("--wait", type=float, default=600.0, help="seconds for a job to end")
    one.set_defaults(command=_import)
    return parser


def _import(given: argparse.Namespace) -> int:
    clean = True
    with Client(given.url) as service:
        for path in _files(given.logs):
            clean &= _counted(path)
            for sample in islice(logged_samples(path), given.limit):
                found: Imported | Unusable = (
                    sample
                    if isinstance(sample, Unusable)
                    else bring(sample, service, agent=given.agent, within_s=given.wait)
                )
                clean &= _told(found)
    return 0 if clean else 1


def _told(found: Imported | Unusable) -> bool:
    """Prints what came of a sample; whether it is a job that says what its log says."""
    about = f"{found.sample} epoch {found.epoch}"
    if isinstance(found, Unusable):
        _say(f"{about}: left out: {found.why}")
        return False
    again = ", brought before" if found.again else ""
    outcome = found.outcome or "has not ended yet"
    _say(f"{about}: {found.job} by agent/{found.agent}{again}: {outcome}")
    for difference in found.differences:
        _say(f"  {difference}")
    return found.outcome is not None and not found.differences


def _counted(path: Path) -> bool:
    """Says how many samples a log has; whether these are all that were planned."""
    state = state_of(path)
    _say(state.sentence)
    return state.is_whole


def _files(places: Sequence[Path]) -> list[Path]:
    """The logs that were named, and those in folders that were."""
    found: list[Path] = []
    for place in places:
        found += sorted(place.glob("*.eval")) if place.is_dir() else [place]
    return found


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")


if __name__ == "__main__":
    sys.exit(main())
