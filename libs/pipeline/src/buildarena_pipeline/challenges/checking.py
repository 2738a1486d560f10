"""A package against its season: every check, and the score of what passes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

from buildarena_besiege.importing.xml_file import FileMachine
from buildarena_besiege.logs.tracker_file import TrackerFile
from buildarena_pipeline.challenges.findings import CheckFailed, Finding
from buildarena_pipeline.challenges.flights import (
    read_flight,
    require_no_jump,
    require_sound,
    require_target,
)
from buildarena_pipeline.challenges.machines import (
    cost_of,
    read_actions,
    read_file,
    require_allowed,
    require_full_has_valid,
    require_history_builds_raw,
    require_no_program,
    require_same_machine,
)
from buildarena_pipeline.challenges.package import Package
from buildarena_pipeline.challenges.scores import FlightScore, score_flight
from buildarena_pipeline.challenges.season import Season, SeasonError

_SHORTEST_TRANSCRIPT: Final = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """What a season says of a package.

    Attributes:
        season: The season's name.
        track: The track's name.
        findings: Of each check, in their order.
        score: Of the flight; None where the flight is not sound.
    """

    season: str
    track: str
    findings: tuple[Finding, ...]
    score: FlightScore | None

    @property
    def passed(self) -> bool:
        """Whether every check did."""
        return all(finding.passed for finding in self.findings)


class _Contents:
    """The package's files, each read once and only where a check needs it."""

    def __init__(self, package: Package, season: Season, track: str) -> None:
        self.package, self.season = package, season
        self.names = season.files
        self.track = season.tracks[track]

    @cached_property
    def raw(self) -> FileMachine:
        return read_file(self._bytes(self.names.raw), self.names.raw)

    @cached_property
    def tuned(self) -> FileMachine:
        return read_file(self._bytes(self.names.tuned), self.names.tuned)

    @cached_property
    def history(self) -> list[dict[str, Any]]:
        return read_actions(self._bytes(self.names.history), self.names.history)

    @cached_property
    def full_history(self) -> list[dict[str, Any]]:
        return read_actions(self._bytes(self.names.full_history), self.names.full_history)

    @cached_property
    def flight(self) -> TrackerFile:
        return read_flight(self._bytes(self.names.trajectory), self.names.trajectory)

    @property
    def transcript(self) -> bytes:
        return self._bytes(self.names.transcript)

    def _bytes(self, name: str) -> bytes:
        try:
            return self.package.files[name]
        except KeyError:
            raise CheckFailed(f"{name} is missing") from None


def check_package(package: Package, season: Season, track: str) -> Report:
    """Checks a package, and scores its flight.

    Args:
        package: What was handed in.
        season: Its season.
        track: The name of the track.

    Raises:
        SeasonError: The season has no such track.
    """
    if track not in season.tracks:
        raise SeasonError(
            f"{season.name} has no track {track[:40]!r}; there is {', '.join(season.tracks)}"
        )
    contents = _Contents(package, season, track)
    findings = tuple(_finding(name, check, contents) for name, check in CHECKS.items())
    failed = {finding.check for finding in findings if not finding.passed}
    score = None
    if not failed & _OF_FLIGHT:
        score = score_flight(
            contents.flight,
            season.score,
            contents.track,
            cost=cost_of(contents.raw, season.dialect),
            track_name=track,
        )
    return Report(season=season.name, track=track, findings=findings, score=score)


def _finding(name: str, check: Callable[[_Contents], str], contents: _Contents) -> Finding:
    try:
        return Finding(check=name, passed=True, sentence=check(contents))
    except CheckFailed as failure:
        return Finding(check=name, passed=False, sentence=str(failure))


def _files(contents: _Contents) -> str:
    expected = set(contents.names.by_role().values())
    if not contents.track.transcript:
        expected.discard(contents.names.transcript)
    there = set(contents.package.files)
    missing = sorted(expected - there)
    if missing:
        raise CheckFailed(f"{missing[0]} is missing; the package has {_listed(sorted(there))}")
    further = sorted(there - set(contents.names.by_role().values()))
    if further:
        raise CheckFailed(
            f"{further[0]} is none of the package's files: {_listed(sorted(expected))}"
        )
    return f"the {len(there)} files of a package"


def _listed(names: list[str]) -> str:
    return ", ".join(name[:60] for name in names[:8]) or "no file"


def _history(contents: _Contents) -> str:
    return require_history_builds_raw(
        contents.history,
        contents.raw,
        version=contents.season.dialect,
        names=(contents.names.history, contents.names.raw),
    )


def _full_history(contents: _Contents) -> str:
    names = (contents.names.full_history, contents.names.history)
    return require_full_has_valid(contents.full_history, contents.history, names=names)


def _tuned(contents: _Contents) -> str:
    names = (contents.names.raw, contents.names.tuned)
    return require_same_machine(contents.raw, contents.tuned, names=names)


def _modules(contents: _Contents) -> str:
    return require_allowed(contents.raw, contents.season.allowed, contents.names.raw)


def _programs(contents: _Contents) -> str:
    mods = contents.season.tracker.mods
    require_no_program(contents.raw, mods, contents.names.raw)
    return require_no_program(contents.tuned, mods, contents.names.tuned)


def _target(contents: _Contents) -> str:
    return require_target(contents.flight, contents.raw, contents.names.trajectory)


def _samples(contents: _Contents) -> str:
    return require_sound(contents.flight, contents.season.tracker, contents.names.trajectory)


def _jumps(contents: _Contents) -> str:
    require_sound(contents.flight, contents.season.tracker, contents.names.trajectory)
    return require_no_jump(contents.flight, contents.season.tracker, contents.names.trajectory)


def _transcript(contents: _Contents) -> str:
    name = contents.names.transcript
    if not contents.track.transcript and name not in contents.package.files:
        return "this track needs none"
    try:
        text = contents.transcript.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise CheckFailed(f"{name}: it is not UTF-8: {error.reason}") from error
    if len(text.strip()) < _SHORTEST_TRANSCRIPT:
        raise CheckFailed(
            f"{name}: it has {len(text.strip())} characters; a conversation has at least "
            f"{_SHORTEST_TRANSCRIPT}"
        )
    return f"{len(text):,} characters"


CHECKS: Final[dict[str, Callable[[_Contents], str]]] = {
    "files": _files,
    "history": _history,
    "full-history": _full_history,
    "modules": _modules,
    "programs": _programs,
    "tuned": _tuned,
    "target": _target,
    "samples": _samples,
    "jumps": _jumps,
    "transcript": _transcript,
}
"""What a package must pass, in the order in which it is told."""
_OF_FLIGHT: Final = frozenset({"target", "samples", "jumps"})
