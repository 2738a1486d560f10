"""A folder of packages as an organiser sees it: who passes, who leads, who copied whom."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from buildarena_pipeline.challenges.checking import Report, contents_of
from buildarena_pipeline.challenges.package import (
    Package,
    PackageError,
    packed_package,
    read_package,
)
from buildarena_pipeline.challenges.scores import PackageScore, ranks_of
from buildarena_pipeline.challenges.season import Season
from buildarena_store import Checked


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
    contents = contents_of(package, season, track)
    report = contents.report()
    score = report.score
    return Checked(
        passed=report.passed,
        reason=next((each.sentence for each in report.findings if not each.passed), ""),
        report={**asdict(report), "passed": report.passed},
        rules=season.digest,
        points=None if score is None else score.points,
        cost=None if score is None else score.cost,
        fingerprints=sorted(contents.fingerprints()),
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
        replace(entry, rank=rank) for entry, rank in zip(passing, ranks_of(points), strict=True)
    ]
    with_rank.sort(key=lambda entry: (entry.rank, entry.name))
    return (*with_rank, *(entry for entry in entries if entry not in passing))


def _judged(place: Path, season: Season, track: str) -> tuple[Entry, frozenset[str]]:
    try:
        package = read_package(place)
    except PackageError as error:
        return Entry(name=place.name, refused=str(error)), frozenset()
    contents = contents_of(package, season, track)
    report = contents.report()
    refused = next((each.sentence for each in report.findings if not each.passed), "")
    entry = Entry(name=place.name, report=report, refused=refused, score=report.score)
    return entry, contents.fingerprints()


def fingerprints(package: Package, season: Season) -> frozenset[str]:
    """What near-copies share: the history without names, and machines without guids."""
    return contents_of(package, season, next(iter(season.tracks))).fingerprints()


def _copies(k: int, prints: Sequence[frozenset[str]], names: Sequence[str]) -> Iterator[str]:
    for other, name in enumerate(names):
        if other != k and prints[other] & prints[k]:
            yield name
