"""Tallies and their details as rows keep them: what is said once, and the figures of each trial."""

from __future__ import annotations

from buildarena_geometry import kernels  # noqa: F401 - before numpy

# isort: split

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from datetime import datetime
from itertools import accumulate, pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.leaderboard import DETAILS, Details, Tally, Total

_FLOATS: Final[np.dtype[Any]] = np.dtype(">f8")
_INTEGERS: Final[np.dtype[Any]] = np.dtype(">i8")
"""As the database sends them."""
_FIGURES: Final = {
    "indicators": _FLOATS,
    "shares": _FLOATS,
    "gained": _FLOATS,
    "costs_usd": _FLOATS,
    "output_tokens": _INTEGERS,
}
"""Fields of a tally that are arrays, in the order in which they are kept, each of all tallies."""


def floats(data: bytes) -> NDArray[np.float64]:
    """Numbers as the database sends them."""
    return np.frombuffer(data, _FLOATS).astype(np.float64)


def integers(data: bytes) -> NDArray[np.int64]:
    """Numbers as the database sends them."""
    return np.frombuffer(data, _INTEGERS).astype(np.int64)


def pack_tallies(tallies: Sequence[Tally]) -> tuple[list[dict[str, Any]], bytes]:
    """What tallies say once, and the figures of each trial."""
    said = [
        {
            "number": tally.number,
            "outcome": tally.outcome,
            "reason": tally.reason,
            "success": tally.success,
            "flags": list(tally.flags),
            "by_runner": tally.by_runner,
            "unverified": tally.unverified,
            "requests": asdict(tally.requests),
            "input_tokens": asdict(tally.input_tokens),
            "parts": asdict(tally.parts),
            "actions": tally.actions,
            "refused_actions": tally.refused_actions,
            "refusals": dict(sorted(tally.refusals.items())),
            "newest": tally.newest.isoformat() if tally.newest else None,
        }
        for tally in tallies
    ]
    figures = (
        getattr(tally, name).astype(kind).tobytes()
        for name, kind in _FIGURES.items()
        for tally in tallies
    )
    return said, b"".join(figures)


def pack_details(details: Sequence[Details]) -> bytes:
    """The details of all tallies of a row; refusals last, in the order of the tally's classes."""
    columns = [one.columns for one in details] or [np.zeros((len(DETAILS), 0), np.int64)]
    refusals = [times for one in details for _, times in sorted(one.refusals.items())]
    arrays = [np.concatenate(columns, axis=1), *refusals]
    return b"".join(array.astype(_INTEGERS).tobytes() for array in arrays)


def unpack_tallies(said: Sequence[Mapping[str, Any]], figures: bytes) -> list[Tally]:
    """The tallies of a row."""
    tallies = []
    for one, arrays in zip(said, _unpacked(said, figures), strict=True):
        tallies.append(
            Tally(
                **arrays,
                outcome=one["outcome"],
                reason=one["reason"],
                success=one["success"],
                flags=tuple(one["flags"]),
                by_runner=one["by_runner"],
                unverified=one["unverified"],
                requests=Total(**one["requests"]),
                input_tokens=Total(**one["input_tokens"]),
                parts=Total(**one["parts"]),
                actions=one["actions"],
                refused_actions=one["refused_actions"],
                refusals=one["refusals"],
                newest=datetime.fromisoformat(one["newest"]) if one["newest"] else None,
            )
        )
    return tallies


def unpack_details(said: Sequence[Mapping[str, Any]], data: bytes) -> list[Details]:
    """The details of a row's tallies."""
    ends = _ends(said)
    columns = np.frombuffer(data, _INTEGERS, len(DETAILS) * ends[-1]).astype(np.int64)
    details, start = [], columns.nbytes
    for one, (begin, end) in zip(said, pairwise(ends), strict=True):
        refusals = {}
        for name in sorted(one["refusals"]):
            refusals[name] = np.frombuffer(data, _INTEGERS, one["number"], start).astype(np.int64)
            start += refusals[name].nbytes
        own = columns.reshape(len(DETAILS), -1)[:, begin:end]
        details.append(Details(columns=own, refusals=refusals))
    return details


def _ends(said: Sequence[Mapping[str, Any]]) -> list[int]:
    """Where each tally's trials begin among a row's, and where the last one's end."""
    return list(accumulate((one["number"] for one in said), initial=0))


def _unpacked(
    said: Sequence[Mapping[str, Any]], figures: bytes
) -> Iterator[dict[str, NDArray[Any]]]:
    """The arrays of each tally."""
    ends = _ends(said)
    columns, start = {}, 0
    for name, kind in _FIGURES.items():
        values = np.frombuffer(figures, kind, ends[-1], start)
        columns[name] = values.astype(np.float64 if kind == _FLOATS else np.int64)
        start += values.nbytes
    for begin, end in pairwise(ends):
        yield {name: values[begin:end] for name, values in columns.items()}
