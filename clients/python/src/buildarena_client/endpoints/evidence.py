"""What evenings with the real game showed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final, cast

from buildarena_client.endpoints.sending import Sender
from buildarena_client.paths import at

if TYPE_CHECKING:
    from buildarena_client.schemas import AddedEvidence, EvidenceDetail, EvidenceView

EVIDENCE: Final = at("besiege", "evidence")


class Evidence(Sender):
    """What evenings with the real game showed."""

    async def add_evidence(self, source: Path | bytes) -> AddedEvidence:
        """Adds evidence, whose logs are read and judged again; for admins.

        Args:
            source: The ZIP file that `buildarena besiege first-evening` wrote, or its bytes.
        """
        answer = await self.upload(EVIDENCE, source, "application/zip", repeatable=True)
        return cast("AddedEvidence", answer)

    async def evidence(self) -> list[EvidenceView]:
        """What there is, the newest first."""
        return cast("list[EvidenceView]", await self.get(EVIDENCE))

    async def evidence_table(self, evidence_id: str) -> EvidenceDetail:
        """One table: assumed, expected, seen, verdict.

        Args:
            evidence_id: Its id, or the beginning.
        """
        return cast("EvidenceDetail", await self.get(at("besiege", "evidence", evidence_id)))

    async def evidence_file(self, evidence_id: str) -> bytes:
        """The file as it was sent.

        Args:
            evidence_id: Its id, or the beginning.
        """
        return await self.get_bytes(at("besiege", "evidence", evidence_id, "file"))
