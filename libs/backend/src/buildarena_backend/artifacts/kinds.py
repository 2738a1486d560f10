"""Valid names of artifacts, and their media types."""

from __future__ import annotations

from typing import Final

JSON: Final = "application/json"
PARQUET: Final = "application/vnd.apache.parquet"
PNG: Final = "image/png"
EVIDENCE: Final = {
    "bsg": "application/xml",
    "json": JSON,
    "lua": "text/x-lua",
    "png": PNG,
    "txt": "text/plain",
}
"""Media types of evidence from trials in the game, by file ending."""
MEDIA_TYPES: Final = tuple(sorted({JSON, PARQUET, *EVIDENCE.values()}))
EVIDENCE_NAME: Final = (
    r"(log|machine|screenshot|script|state)-[0-9]{1,6}(-[0-9]{1,20}){0,2}\.(bsg|json|lua|png|txt)"
)
"""KIND-NUMBER.ENDING, with the rollout's number."""
NAME: Final = rf"^(machine|transcript|thumbnail|trajectory-[0-9]{{1,5}}|{EVIDENCE_NAME})$"
