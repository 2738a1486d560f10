"""Reads evidence that a stranger sends: bounded, and nothing in it believed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from pydantic import ValidationError

from buildarena_geometry.json_texts import read_json
from buildarena_pipeline.evidence.archive_names import (
    DOCUMENT,
    MAX_BYTES,
    MAX_DOCUMENT_BYTES,
    MAX_MEMBER_BYTES,
    MAX_MEMBERS,
    MAX_RATIO,
    MAX_UNPACKED_BYTES,
    MEMBER,
    PAGE,
    PNG,
    SMALL_BYTES,
)
from buildarena_pipeline.evidence.document import (
    FORMAT,
    Evidence,
    EvidenceError,
    StepRecord,
)
from buildarena_pipeline.evidence.reading_runs import StepInputs
from buildarena_pipeline.evidence.steps import judged, step_named
from buildarena_pipeline.zip_files import ZipBounds, ZipFileError, zip_members

MAX_DEPTH: Final = 16
_SHOWN: Final = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadEvidence:
    """Evidence that was read, and judged again.

    Attributes:
        evidence: With figures and verdicts of its files; those of its sender that differ are in
            ``stated``.
        files: Its other members by name, without the sender's page.
    """

    evidence: Evidence
    files: Mapping[str, bytes] = field(repr=False)


def read_evidence(data: bytes) -> ReadEvidence:
    """The evidence of a file, its logs read and judged again.

    Args:
        data: The file.

    Raises:
        EvidenceError: It is none, or breaks a bound.
    """
    if len(data) > MAX_BYTES:
        raise EvidenceError(f"it has {len(data):,} bytes: at most {MAX_BYTES:,} are read")
    members = _members(data)
    document = members.pop(DOCUMENT, None)
    if document is None:
        raise EvidenceError(f"it has no {DOCUMENT}")
    members.pop(PAGE, None)
    evidence = _evidence(document)
    files: dict[str, dict[str, bytes]] = {step.name: {} for step in evidence.steps}
    for name, content in members.items():
        step, file = _named(name)
        if step not in files:
            raise EvidenceError(f"{name} is of no step that {DOCUMENT} tells of")
        if file.endswith(".png") and not content.startswith(PNG):
            raise EvidenceError(f"{name} is no picture")
        files[step][file] = content
    steps = tuple(_judged(step, evidence, files[step.name]) for step in evidence.steps)
    return ReadEvidence(evidence=evidence.model_copy(update={"steps": steps}), files=members)


def _judged(step: StepRecord, evidence: Evidence, files: Mapping[str, bytes]) -> StepRecord:
    return judged(
        StepInputs(record=step, files=files, versions=evidence.versions, driver=evidence.driver)
    )


def _evidence(document: bytes) -> Evidence:
    content = _json(document)
    version = content.get("format") if isinstance(content, dict) else None
    if version != FORMAT or isinstance(version, bool):
        raise EvidenceError(
            f"{DOCUMENT} has format {str(version)[:20]}; this program reads {FORMAT}"
        )
    try:
        evidence = Evidence.model_validate(content)
    except ValidationError as error:
        raise EvidenceError(f"{DOCUMENT}: {_spelled(error)}") from error
    twice = [name for name, n in Counter(step.name for step in evidence.steps).items() if n > 1]
    if twice:
        raise EvidenceError(f"step {twice[0]} is in it twice")
    for step in evidence.steps:
        step_named(step.name)
        numbers = [run.number for run in step.runs]
        if numbers != list(range(1, len(numbers) + 1)):
            raise EvidenceError(f"the runs of step {step.name} are not numbered from 1")
    return evidence


def _json(document: bytes) -> Any:
    try:
        return read_json(document.decode("utf-8"), MAX_DEPTH)
    except (ValueError, RecursionError) as error:
        raise EvidenceError(f"{DOCUMENT} cannot be read: {error}") from error


def _members(data: bytes) -> dict[str, bytes]:
    """The members, the sender's page left aside."""
    bounds = ZipBounds(
        members=MAX_MEMBERS,
        unpacked_bytes=MAX_UNPACKED_BYTES,
        ratio=MAX_RATIO,
        small_bytes=SMALL_BYTES,
    )
    try:
        return zip_members(data, bounds, limit_of=_limit_of, unread=frozenset({PAGE}))
    except ZipFileError as error:
        raise EvidenceError(str(error)) from error


def _limit_of(name: str) -> int:
    if name == PAGE:
        return MAX_UNPACKED_BYTES
    if name == DOCUMENT:
        return MAX_DOCUMENT_BYTES
    _named(name)
    return MAX_MEMBER_BYTES


def _named(name: str) -> tuple[str, str]:
    matched = MEMBER.fullmatch(name)
    if matched is None:
        raise EvidenceError(
            f"no member is called {name[:100]!r}: there are {DOCUMENT}, {PAGE} and steps/STEP/NAME"
        )
    return matched[1], matched[2]


def _spelled(error: ValidationError) -> str:
    faults = [
        f"{'.'.join(map(str, item['loc']))}: {item['msg'].removeprefix('Value error, ')}"
        for item in error.errors(include_url=False, include_input=False)
    ]
    return "; ".join(faults[:_SHOWN]) + ("; …" if len(faults) > _SHOWN else "")
