"""Leaderboards, and other results over many jobs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, Unpack, cast

from buildarena_client.endpoints.base import Sender

if TYPE_CHECKING:
    from buildarena_client.schemas import Board, BoardFilters, Comparison, VerifyAccepted


class Boards(Sender):
    """Leaderboards, and other results over many jobs."""

    async def leaderboard(self, **filters: Unpack[BoardFilters]) -> Board:
        """Return one track's leaderboard, on each task and overall.

        Args:
            filters: Filters of the jobs that count. Defaults to the standard track, or the one with
                most ended jobs.
        """
        return cast("Board", await self.get("/v1/leaderboard", **filters))

    async def compare(self, first: str, second: str, **filters: Unpack[BoardFilters]) -> Comparison:
        """Return a comparison of two models of a leaderboard, by its tests.

        Args:
            first: Model, or ``model@configuration``.
            second: Another one.
            filters: Filters of the jobs that count.
        """
        answer = await self.get("/v1/leaderboard/compare", first=first, second=second, **filters)
        return cast("Comparison", answer)

    async def verify_leaderboard(
        self,
        model: str,
        *,
        track: str | None = None,
        tasks: list[str] | None = None,
        sample: int | None = None,
        seed: int = 0,
    ) -> VerifyAccepted:
        """Request verifications of all of a model's results, or of a sample.

        Args:
            track: Track of the results. Defaults to that of `leaderboard`.
            tasks: Tasks of the results. Defaults to all.
            sample: Size of the sample. Defaults to all.
            seed: Seed of the sample.
        """
        body = {"model": model, "track": track, "tasks": tasks, "sample": sample, "seed": seed}
        return cast("VerifyAccepted", await self.post("/v1/leaderboard/verify", body))

    async def export_leaderboard(
        self, kind: Literal["csv", "parquet", "latex"], **filters: Unpack[BoardFilters]
    ) -> bytes:
        """Return a leaderboard as a file.

        Args:
            kind: Format of the file.
            filters: Filters of the jobs that count.
        """
        return await self.get_bytes("/v1/leaderboard/export", format=kind, **filters)
