"""A package against its season: every check, and the score of what passes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

from buildarena_besiege.importing.xml_file import FileMachine
from buildarena_besiege.logs.tracker_file import TrackerFile
from buildarena_geometry import Machine
from buildarena_pipeline.challenges.findings import CheckFailed, Finding
from buildarena_pipeline.challenges.flights import (
    read_flight,
    require_no_jump,
    require_sound,
    require_target,
)
from buildarena_pipeline.challenges.likeness import digest, nameless, shape_of_file
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
from buildarena_pipeline.challenges.scores import PackageScore, score_flight, summed
from buildarena_pipeline.challenges.season import (
    OrbitScore,
    Season,
    SeasonError,
    TrialsScore,
    machine_file,
)
from buildarena_pipeline.challenges.trials import (
    cost_of_machine,
    points_of,
    read_machine,
    require_modules,
    require_playable,
    shape_of,
    task_named,
    term_of,
)

_SHORTEST_TRANSCRIPT: Final = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """What a season says of a package.

    Attributes:
        season: The season's name.
        track: The track's name.
        findings: Of each check, in their order.
        score: None where what is scored breaks a rule.
    """

    season: str
    track: str
    findings: tuple[Finding, ...]
    score: PackageScore | None

    @property
    def passed(self) -> bool:
        """Whether every check did."""
        return all(finding.passed for finding in self.findings)


class Contents:
    """A package's files, and what every season asks of them."""

    def __init__(self, package: Package, season: Season, track: str) -> None:
        self.package, self.season = package, season
        self.track_name, self.track = track, season.tracks[track]

    @property
    def checks(self) -> dict[str, Callable[[], str]]:
        """What the package must pass, in the order in which it is told."""
        return {"files": self._files, **self.own_checks, "transcript": self._transcript}

    @property
    def own_checks(self) -> dict[str, Callable[[], str]]:
        """What packages of this formula must pass."""
        raise NotImplementedError

    @property
    def scored_checks(self) -> frozenset[str]:
        """Without which there is no score."""
        raise NotImplementedError

    def score(self) -> PackageScore:
        """The score; `scored_checks` passed."""
        raise NotImplementedError

    def fingerprints(self) -> frozenset[str]:
        """What near-copies share, as far as the files can be read."""
        raise NotImplementedError

    def report(self) -> Report:
        """Every check, and the score where what is scored keeps the rules."""
        findings = tuple(_finding(name, check) for name, check in self.checks.items())
        failed = {finding.check for finding in findings if not finding.passed}
        return Report(
            season=self.season.name,
            track=self.track_name,
            findings=findings,
            score=None if failed & self.scored_checks else self.score(),
        )

    def file(self, name: str) -> bytes:
        """A file's bytes.

        Raises:
            CheckFailed: It is missing.
        """
        try:
            return self.package.files[name]
        except KeyError:
            raise CheckFailed(f"{name} is missing") from None

    def _files(self) -> str:
        own, transcript = set(self.season.score.file_names), self.season.transcript
        expected = own | ({transcript} if self.track.transcript else set())
        there = set(self.package.files)
        missing = sorted(expected - there)
        if missing:
            raise CheckFailed(f"{missing[0]} is missing; the package has {_listed(sorted(there))}")
        further = sorted(there - own - {transcript})
        if further:
            raise CheckFailed(
                f"{further[0][:60]} is none of the package's files: {_listed(sorted(expected))}"
            )
        return f"the {len(there)} files of a package"

    def _transcript(self) -> str:
        name = self.season.transcript
        if not self.track.transcript and name not in self.package.files:
            return "this track needs none"
        try:
            text = self.file(name).decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise CheckFailed(f"{name}: it is not UTF-8: {error.reason}") from error
        if len(text.strip()) < _SHORTEST_TRANSCRIPT:
            raise CheckFailed(
                f"{name}: it has {len(text.strip())} characters; a conversation has at least "
                f"{_SHORTEST_TRANSCRIPT}"
            )
        return f"{len(text):,} characters"


class _Flight(Contents):
    """A flight in the game: histories, machines and what the tracker wrote."""

    def __init__(self, package: Package, season: Season, track: str, rule: OrbitScore) -> None:
        super().__init__(package, season, track)
        self.rule, self.names = rule, rule.files

    @cached_property
    def raw(self) -> FileMachine:
        return read_file(self.file(self.names.raw), self.names.raw)

    @cached_property
    def tuned(self) -> FileMachine:
        return read_file(self.file(self.names.tuned), self.names.tuned)

    @cached_property
    def valid(self) -> list[dict[str, Any]]:
        return read_actions(self.file(self.names.history), self.names.history)

    @cached_property
    def flight(self) -> TrackerFile:
        return read_flight(self.file(self.names.trajectory), self.names.trajectory)

    @property
    def own_checks(self) -> dict[str, Callable[[], str]]:
        return {
            "history": self._history,
            "full-history": self._full_history,
            "modules": self._modules,
            "programs": self._programs,
            "tuned": self._tuned,
            "target": self._target,
            "samples": lambda: self.soundness,
            "jumps": self._jumps,
        }

    @property
    def scored_checks(self) -> frozenset[str]:
        return frozenset({"target", "samples", "jumps"})

    def score(self) -> PackageScore:
        cost = cost_of(self.raw, self.rule.dialect)
        return score_flight(
            self.flight, self.rule, self.track, cost=cost, track_name=self.track_name
        )

    def fingerprints(self) -> frozenset[str]:
        prints = set()
        with suppress(CheckFailed):
            prints.add(digest([nameless(action) for action in self.valid]))
        with suppress(CheckFailed):
            prints.add(digest(shape_of_file(self.raw)))
        return frozenset(prints)

    def _history(self) -> str:
        names = (self.names.history, self.names.raw)
        version = self.rule.dialect
        return require_history_builds_raw(self.valid, self.raw, version=version, names=names)

    def _full_history(self) -> str:
        full = read_actions(self.file(self.names.full_history), self.names.full_history)
        names = (self.names.full_history, self.names.history)
        return require_full_has_valid(full, self.valid, names=names)

    def _tuned(self) -> str:
        names = (self.names.raw, self.names.tuned)
        return require_same_machine(self.raw, self.tuned, names=names)

    def _modules(self) -> str:
        return require_allowed(self.raw, self.season.allowed, self.names.raw)

    def _programs(self) -> str:
        mods = self.rule.tracker.mods
        require_no_program(self.raw, mods, self.names.raw)
        return require_no_program(self.tuned, mods, self.names.tuned)

    def _target(self) -> str:
        return require_target(self.flight, self.raw, self.names.trajectory)

    @cached_property
    def soundness(self) -> str:
        return require_sound(self.flight, self.rule.tracker, self.names.trajectory)

    def _jumps(self) -> str:
        # Steps between samples mean something only where these are sound.
        _ = self.soundness
        return require_no_jump(self.flight, self.rule.tracker, self.names.trajectory)


class _Trials(Contents):
    """Machines for some tasks, which are tried here."""

    def __init__(self, package: Package, season: Season, track: str, rule: TrialsScore) -> None:
        super().__init__(package, season, track)
        self.rule, self._read = rule, dict[str, Machine]()

    @cached_property
    def machines(self) -> dict[str, Machine]:
        return {task: self._machine(task) for task in self.rule.tasks}

    def _machine(self, task: str) -> Machine:
        if task not in self._read:
            name = machine_file(task)
            self._read[task] = read_machine(self.file(name), name)
        return self._read[task]

    def fingerprints(self) -> frozenset[str]:
        prints = set()
        for task in self.rule.tasks:
            with suppress(CheckFailed):
                prints.add(digest(shape_of(self._machine(task))))
        return frozenset(prints)

    @property
    def own_checks(self) -> dict[str, Callable[[], str]]:
        return {"machines": self._machines, "modules": self._modules}

    @property
    def scored_checks(self) -> frozenset[str]:
        return frozenset({"machines", "modules"})

    def score(self) -> PackageScore:
        points = points_of(len(self.rule.tasks))
        terms = [
            term_of(self.machines[task], task_named(task), full=full, points=points)
            for task, full in self.rule.tasks.items()
        ]
        cost = sum(map(cost_of_machine, self.machines.values()))
        return summed(terms, self.rule, self.track, cost=cost, track_name=self.track_name)

    def _machines(self) -> str:
        for task, machine in self.machines.items():
            require_playable(machine, task_named(task), machine_file(task))
        parts = ", ".join(f"{machine.part_count}" for machine in self.machines.values())
        return f"{len(self.machines)} machines of {parts} parts"

    def _modules(self) -> str:
        for task, machine in self.machines.items():
            require_modules(machine, self.season.allowed, machine_file(task))
        return "the season's modules alone"


def check_package(package: Package, season: Season, track: str) -> Report:
    """Checks a package, and scores it.

    Args:
        package: What was handed in.
        season: Its season.
        track: The name of the track.

    Raises:
        SeasonError: The season has no such track.
    """
    return contents_of(package, season, track).report()


def contents_of(package: Package, season: Season, track: str) -> Contents:
    """The package's files, each read once and only where a check needs it.

    Raises:
        SeasonError: The season has no such track.
    """
    if track not in season.tracks:
        raise SeasonError(
            f"{season.name} has no track {track[:40]!r}; there is {', '.join(season.tracks)}"
        )
    if isinstance(season.score, TrialsScore):
        return _Trials(package, season, track, season.score)
    return _Flight(package, season, track, season.score)


def _finding(name: str, check: Callable[[], str]) -> Finding:
    try:
        return Finding(check=name, passed=True, sentence=check())
    except CheckFailed as failure:
        return Finding(check=name, passed=False, sentence=str(failure))


def _listed(names: list[str]) -> str:
    return ", ".join(name[:60] for name in names[:8]) or "no file"
