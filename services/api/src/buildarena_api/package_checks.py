"""Checks what people hand in to challenges: in a process apart, each package once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import structlog
from sqlalchemy.exc import SQLAlchemyError

from buildarena_api.checking import Checker, CheckFailedError
from buildarena_pipeline.challenges.judging import checked_package
from buildarena_pipeline.challenges.season import Season
from buildarena_pipeline.periodic import Periodic
from buildarena_pipeline.runtime.context import Context
from buildarena_store import Checked, StoredPackage
from buildarena_store.errors import ArtifactStoreError

SPARE_BYTES: Final = 1 << 30
"""Memory for one package."""
LONGEST_S: Final = 60.0
"""Time for one package: most take a tenth of a second."""
PERIOD_S: Final = 1.0

log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What the process apart is asked.

    Attributes:
        data: A ZIP file.
        season: Its season.
        track: Its track.
    """

    data: bytes
    season: Season
    track: str


class PackageChecks:
    """Takes packages that wait and notes what their checks find, one after the other.

    Every API process has one; the database hands each package to one of them.

    Args:
        context: The process' connections.
        seasons: By name.
    """

    def __init__(self, context: Context, seasons: Mapping[str, Season]) -> None:
        self._context, self._seasons = context, seasons
        self._checker = Checker("packages", _judging, spare_bytes=SPARE_BYTES, longest_s=LONGEST_S)
        self._thread = Periodic(self._check_safely, name="packages", period_s=PERIOD_S)
        self._is_first = True

    def start(self) -> None:
        """Begins to check what waits."""
        self._thread.start()

    def close(self) -> None:
        """Ends the thread and the process."""
        self._thread.stop()
        self._checker.close()

    def check_waiting(self) -> int:
        """Checks all that waits; how many there were."""
        if self._is_first:
            for season in self._seasons.values():
                self._context.store.packages.recheck(season.name, season.digest)
            self._is_first = False
        count = 0
        while (package := self._context.store.packages.claim()) is not None:
            try:
                checked = self._checked(package)
            except ArtifactStoreError:
                self._context.store.packages.hand_back(package.id)
                raise
            self._context.store.packages.finish(package.id, checked)
            count += 1
        return count

    def look(self, data: bytes, season: Season, track: str) -> Checked:
        """What a season says of a ZIP file that nobody hands in."""
        try:
            checked: Checked = self._checker.ask(Question(data=data, season=season, track=track))
        except CheckFailedError as error:
            return _refused(f"the package is too much: {error}", rules=season.digest)
        return checked

    def _checked(self, package: StoredPackage) -> Checked:
        season = self._seasons.get(package.season)
        if season is None or package.track not in season.tracks:
            return _refused(f"there is no season {package.season} with a track {package.track}")
        return self.look(self._context.artifacts.get(package.hash), season, package.track)

    def _check_safely(self) -> None:
        try:
            self.check_waiting()
        except (ArtifactStoreError, SQLAlchemyError) as error:
            log.warning("packages_not_checked", error=str(error).splitlines()[0])
        except Exception:
            # Whatever it was, the next time may do.
            log.exception("packages_not_checked")


def _refused(reason: str, *, rules: str = "") -> Checked:
    return Checked(
        passed=False,
        reason=reason,
        report={"findings": [], "score": None, "passed": False},
        rules=rules,
        points=None,
        cost=None,
        fingerprints=(),
    )


def _judging() -> Callable[[Any], Checked]:
    return judge_question


def judge_question(question: Question) -> Checked:
    """What a package's season says of it."""
    return checked_package(question.data, question.season, question.track)
