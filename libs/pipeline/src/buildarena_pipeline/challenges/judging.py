"""A folder of packages as an organiser sees it: who passes, who leads, who copied whom."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

from buildarena_besiege.importing.xml_file import FileMachine
from buildarena_pipeline.challenges.checking import Report, check_package
from buildarena_pipeline.challenges.findings import CheckFailed
from buildarena_pipeline.challenges.machines import read_actions, read_file
from buildarena_pipeline.challenges.package import (
    Package,
    PackageError,
    packed_package,
    read_package,
)
from buildarena_pipeline.challenges.scores import PackageScore
from buildarena_pipeline.challenges.season import Season, TrialsScore
from buildarena_pipeline.challenges.trials import read_machine, shape_of
from buildarena_store import Checked

_WORDS: Final = frozenset({"note", "name", "machine_name"})
"""Arguments that name things: they make no other machine."""
_DECIMALS: Final = 3


def checked_package(data: bytes, season: Season, track: str) -> Checked:
    """What the season says of a ZIP file, as the store keeps it.

    Args:
        data: The file.
        season: Its season.
        track: Its track.
    """
    try:
        package = packed_package(data)
    except PackageError as error:
        return Checked(
            passed=False,
            reason=str(error),
            report={"season": season.name, "track": track, "findings": [], "passed": False},
            rules=season.digest,
            points=None,
            cost=None,
            fingerprints=(),
        )
    report = check_package(package, season, track)
    score = report.score
    return Checked(
        passed=report.passed,
        reason=next((each.sentence for each in report.findings if not each.passed), ""),
        report={**asdict(report), "passed": report.passed},
        rules=season.digest,
        points=None if score is None else score.points,
        cost=None if score is None else score.cost,
        fingerprints=sorted(fingerprints(package, season)),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A package of the folder.

    Attributes:
        name: What its folder or file is called.
        rank: Its place among those that pass, by what is known of their scores; None otherwise.
        report: Every check; None where the package cannot be read.
        refused: Why it does not pass, the first reason; "" where it does.
        score: Of its flight; None without one.
        copies: Other entries whose history is the same up to names, or whose raw machine is.
    """

    name: str
    rank: int | None = None
    report: Report | None = None
    refused: str = ""
    score: PackageScore | None = None
    copies: tuple[str, ...] = ()


def judge_folder(folder: Path, season: Season, track: str) -> tuple[Entry, ...]:
    """All packages of a folder, the best first, those that do not pass last.

    Args:
        folder: Each of its folders and ZIP files is a package.
        season: Their season.
        track: Their track.

    Raises:
        PackageError: There is no such folder, or it has no package.
    """
    if not folder.is_dir():
        raise PackageError(f"{folder}: it is no folder")
    places = [each for each in sorted(folder.iterdir()) if each.is_dir() or each.suffix == ".zip"]
    if not places:
        raise PackageError(f"{folder}: it has neither folders nor ZIP files")
    judged = [_judged(place, season, track) for place in places]
    prints = [print_ for _, print_ in judged]
    entries = [
        replace(entry, copies=tuple(_copies(k, prints, [entry.name for entry, _ in judged])))
        for k, (entry, _) in enumerate(judged)
    ]
    return ranked(entries)


def ranked(entries: Sequence[Entry]) -> tuple[Entry, ...]:
    """The entries with their ranks: equal scores share the better one."""
    passing = [entry for entry in entries if not entry.refused and entry.score is not None]
    points = [entry.score.points for entry in passing if entry.score is not None]
    with_rank = [
        replace(entry, rank=1 + sum(other > own for other in points))
        for entry, own in zip(passing, points, strict=True)
    ]
    with_rank.sort(key=lambda entry: (entry.rank, entry.name))
    return (*with_rank, *(entry for entry in entries if entry not in passing))


def _judged(place: Path, season: Season, track: str) -> tuple[Entry, frozenset[str]]:
    try:
        package = read_package(place)
    except PackageError as error:
        return Entry(name=place.name, refused=str(error)), frozenset()
    report = check_package(package, season, track)
    refused = next((each.sentence for each in report.findings if not each.passed), "")
    entry = Entry(name=place.name, report=report, refused=refused, score=report.score)
    return entry, fingerprints(package, season)


def fingerprints(package: Package, season: Season) -> frozenset[str]:
    """What near-copies share: the history without names, and the raw machine without guids."""
    return frozenset(_fingerprints(package, season))


def _fingerprints(package: Package, season: Season) -> Iterator[str]:
    if isinstance(season.score, TrialsScore):
        shapes = (_shape_of_file(package, name) for name in season.score.file_names)
        yield from map(_digest, filter(None, shapes))
        return
    names = season.score.files
    with suppress(CheckFailed, KeyError):
        actions = read_actions(package.files[names.history], names.history)
        yield _digest([_nameless(action) for action in actions])
    with suppress(CheckFailed, KeyError):
        yield _digest(_shape(read_file(package.files[names.raw], names.raw)))


def _shape_of_file(package: Package, name: str) -> list[list[object]] | None:
    with suppress(CheckFailed, KeyError):
        return shape_of(read_machine(package.files[name], name))
    return None


def _nameless(action: dict[str, Any]) -> list[Any]:
    arguments = action.get("params", action.get("arguments", {}))
    kept = {name: value for name, value in arguments.items() if name not in _WORDS}
    return [action.get("op", action.get("name")), kept]


def _shape(machine: FileMachine) -> list[Any]:
    """A machine's blocks, in no order: a block and its turn, whichever sign the turn is written."""
    return sorted(
        [block.type, *_rounded(block.position), *_rounded(map(abs, block.rotation))]
        for block in machine.blocks
    )


def _rounded(numbers: Any) -> list[float]:
    return [round(number, _DECIMALS) + 0.0 for number in numbers]


def _digest(content: list[Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _copies(k: int, prints: Sequence[frozenset[str]], names: Sequence[str]) -> Iterator[str]:
    for other, name in enumerate(names):
        if other != k and prints[other] & prints[k]:
            yield name
