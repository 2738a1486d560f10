"""Reads evidence of the game that people hand over: in a process apart, and nothing is believed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from functools import cache
from typing import Any, Final

from buildarena_api.checking import Checker, CheckFailedError
from buildarena_api.http.problems import ProblemError
from buildarena_benchmark import ValidationIssue
from buildarena_pipeline.evidence import EvidenceError, EvidenceTable, read_evidence, table_of

SPARE_BYTES: Final = 1 << 30
"""Memory for one file: unpacked it may have a quarter of it."""
LONGEST_S: Final = 120.0
"""Time for one file: logs of nine tasks, three times each, take some ten seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedEvidence:
    """What a file of evidence shows.

    Attributes:
        made_at: When it was packed, as it says.
        table: What its logs and files show, found here.
    """

    made_at: datetime
    table: EvidenceTable


class EvidenceChecker:
    """Reads and judges files of evidence, one at a time."""

    def __init__(self) -> None:
        self._checker = Checker("evidence", _reading, spare_bytes=SPARE_BYTES, longest_s=LONGEST_S)

    def read(self, data: bytes) -> JudgedEvidence:
        """What a file shows.

        Raises:
            ProblemError: It is no evidence, or can't be read within the bounds.
        """
        try:
            answer: JudgedEvidence | str = self._checker.ask(data)
        except CheckFailedError as error:
            raise _refused(f"the file is too much: {error}") from error
        if isinstance(answer, str):
            raise _refused(answer)
        return answer

    def close(self) -> None:
        """Ends the process."""
        self._checker.close()


@cache
def shared_evidence_checker() -> EvidenceChecker:
    """This process' checker; its own process begins with the first file and ends with this one."""
    return EvidenceChecker()


def judge_upload(data: bytes) -> JudgedEvidence | str:
    """What a file shows, or why it is no evidence."""
    try:
        evidence = read_evidence(data).evidence
    except EvidenceError as error:
        return str(error)
    return JudgedEvidence(made_at=evidence.made_at, table=table_of(evidence))


def _reading() -> Callable[[Any], JudgedEvidence | str]:
    return judge_upload


def _refused(message: str) -> ProblemError:
    return ProblemError(422, message, errors=[ValidationIssue(path="file", message=message)])
