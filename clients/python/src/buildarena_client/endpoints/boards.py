"""Leaderboards, and other results over many jobs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, Unpack, cast

from buildarena_client.endpoints.sending import Sender

if TYPE_CHECKING:
    from buildarena_client.schemas import Board, BoardFilters, Comparison, VerifyAccepted


class Boards(Sender):
    """Leaderboards, and other results over many jobs."""

    async def leaderboard(self, **filters: Unpack[BoardFilters]) -> Board:
        """One track's leaderboard, on each task and overall.

        Args:
            filters: Which jobs count; the standard track by default, or that with most ended jobs.
        """
        return cast("Board", await self.get("/v1/leaderboard", **filters))

    async def compare(self, first: str, second: str, **filters: Unpack[BoardFilters]) -> Comparison:
        """Two models of a leaderboard side by side, with tests on the seeds that they share.

        Args:
            first: A model, or ``model@configuration``.
            second: Another.
            filters: Which jobs count.
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
        """Asks for verifications of a model's results, of all or of a sample.

        Args:
            model: Whose.
            track: On which track; the default one of `leaderboard` without.
            tasks: On which tasks; all by default.
            sample: How many; all by default.
            seed: Of the sample.
        """
        body = {"model": model, "track": track, "tasks": tasks, "sample": sample, "seed": seed}
        return cast("VerifyAccepted", await self.post("/v1/leaderboard/verify", body))

    async def export_leaderboard(
        self, kind: Literal["csv", "parquet", "latex"], **filters: Unpack[BoardFilters]
    ) -> bytes:
        """A leaderboard as a file.

        Args:
            kind: Of file.
            filters: Which jobs count.
        """
        return await self.get_bytes("/v1/leaderboard/export", format=kind, **filters)
