"""Challenges: seasons, their boards, and packages that are handed in."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final, cast

from buildarena_client.endpoints.sending import Sender
from buildarena_client.paths import at

if TYPE_CHECKING:
    from buildarena_client.schemas import (
        PackageDetail,
        PackagePicture,
        PackageReport,
        PackageView,
        Ranked,
        ReceivedPackage,
        SeasonChangeView,
        SeasonView,
    )

SEASONS: Final = at("seasons")
SUBMISSIONS: Final = at("submissions")


class Challenges(Sender):
    """Challenges: seasons, their boards, and packages that are handed in."""

    async def seasons(self) -> list[SeasonView]:
        """The seasons that the service knows."""
        return cast("list[SeasonView]", await self.get(SEASONS))

    async def season(self, name: str) -> SeasonView:
        """One season.

        Args:
            name: Its name.
        """
        return cast("SeasonView", await self.get(at("seasons", name)))

    async def season_board(self, name: str, track: str) -> list[Ranked]:
        """The packages of a track, the best first.

        Args:
            name: The season's name.
            track: The track's name.
        """
        return cast("list[Ranked]", await self.get(at("seasons", name, "board"), track=track))

    async def season_changes(self, name: str) -> list[SeasonChangeView]:
        """Who decided what of a season's packages, the last change first; for admins.

        Args:
            name: The season's name.
        """
        return cast("list[SeasonChangeView]", await self.get(at("seasons", name, "changes")))

    async def check_package(
        self, source: Path | bytes, *, season: str, track: str
    ) -> PackageReport:
        """What a season's checks find of a ZIP file; nothing of it is kept.

        Args:
            source: The file, or its bytes.
            season: The season's name.
            track: The track's name.
        """
        path = at("submissions", "check")
        answer = await self.upload(
            path, source, "application/zip", repeatable=True, season=season, track=track
        )
        return cast("PackageReport", answer)

    async def submit_package(
        self, source: Path | bytes, *, season: str, track: str, name: str
    ) -> ReceivedPackage:
        """Hands in a package; the same file twice is one package.

        Args:
            source: A ZIP file, or its bytes.
            season: The season's name.
            track: The track's name.
            name: What the entry is called.
        """
        answer = await self.upload(
            SUBMISSIONS,
            source,
            "application/zip",
            repeatable=True,
            season=season,
            track=track,
            name=name,
        )
        return cast("ReceivedPackage", answer)

    async def packages(
        self, *, season: str | None = None, state: str | None = None, own: bool = False
    ) -> list[PackageView]:
        """The packages that were handed in last, the newest first.

        Args:
            season: Only of this season.
            state: Only in this state.
            own: Only those of the key that asks.
        """
        listed = await self.get(SUBMISSIONS, season=season, state=state, own=own or None)
        return cast("list[PackageView]", listed)

    async def package(self, package_id: str) -> PackageDetail:
        """One package with every check.

        Args:
            package_id: Its id.
        """
        return cast("PackageDetail", await self.get(at("submissions", package_id)))

    async def package_picture(self, package_id: str) -> PackagePicture:
        """Machines and flight of a package that passed its checks.

        Args:
            package_id: Its id.
        """
        answer = await self.get(at("submissions", package_id, "picture"))
        return cast("PackagePicture", answer)

    async def package_file(self, package_id: str) -> bytes:
        """The file as it was handed in.

        Args:
            package_id: Its id.
        """
        return await self.get_bytes(at("submissions", package_id, "file"))

    async def decide_package(self, package_id: str, *, state: str, reason: str) -> PackageDetail:
        """Accepts or refuses a package that was checked; for admins.

        Args:
            package_id: Its id.
            state: "accepted" or "refused".
            reason: Why, a sentence that stays.
        """
        body = {"state": state, "reason": reason}
        answer = await self.post(at("submissions", package_id, "decision"), body, repeatable=True)
        return cast("PackageDetail", answer)

    async def withdraw_package(self, package_id: str) -> PackageDetail:
        """Takes a package off its board.

        Args:
            package_id: Its id.
        """
        answer = await self.post(at("submissions", package_id, "withdraw"), repeatable=True)
        return cast("PackageDetail", answer)
