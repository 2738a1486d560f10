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

from buildarena_benchmark.leaderboard import Details, Tally, Total

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
"""Fields of a tally that are arrays, in the order in which they are kept."""
_DETAILS: Final = {
    "finished_us": _INTEGERS,
    "input_tokens": _INTEGERS,
    "requests": _INTEGERS,
    "parts": _INTEGERS,
    "actions": _INTEGERS,
    "refused_actions": _INTEGERS,
}
"""The same of details; refusals follow, in the order of the classes that the tally names."""


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
            "imported": tally.imported,
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
    return said, _packed(tallies, _FIGURES)


def pack_details(details: Sequence[Details]) -> bytes:
    """The details of all tallies of a row."""
    refusals = (
        times.astype(_INTEGERS).tobytes()
        for one in details
        for _, times in sorted(one.refusals.items())
    )
    return _packed(details, _DETAILS) + b"".join(refusals)


def unpack_tallies(said: Sequence[Mapping[str, Any]], figures: bytes) -> list[Tally]:
    """The tallies of a row."""
    tallies = []
    for one, arrays in zip(said, _unpacked(said, figures, _FIGURES), strict=True):
        tallies.append(
            Tally(
                **arrays,
                outcome=one["outcome"],
                reason=one["reason"],
                success=one["success"],
                flags=tuple(one["flags"]),
                imported=one["imported"],
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
    details, start = [], sum(one["number"] for one in said) * _bytes_of_each(_DETAILS)
    for one, arrays in zip(said, _unpacked(said, data, _DETAILS), strict=True):
        refusals = {}
        for name in sorted(one["refusals"]):
            refusals[name] = np.frombuffer(data, _INTEGERS, one["number"], start).astype(np.int64)
            start += refusals[name].nbytes
        details.append(Details(**arrays, refusals=refusals))
    return details


def _packed(parts: Sequence[Tally | Details], kinds: Mapping[str, np.dtype[Any]]) -> bytes:
    """Their arrays, one field after another, so that those of a row are read at once."""
    return b"".join(
        getattr(part, name).astype(kind).tobytes() for name, kind in kinds.items() for part in parts
    )


def _unpacked(
    said: Sequence[Mapping[str, Any]], data: bytes, kinds: Mapping[str, np.dtype[Any]]
) -> Iterator[dict[str, NDArray[Any]]]:
    """The arrays of each part."""
    ends = list(accumulate((one["number"] for one in said), initial=0))
    columns, start = {}, 0
    for name, kind in kinds.items():
        values = np.frombuffer(data, kind, ends[-1], start)
        columns[name] = values.astype(np.float64 if kind == _FLOATS else np.int64)
        start += values.nbytes
    for begin, end in pairwise(ends):
        yield {name: values[begin:end] for name, values in columns.items()}


def _bytes_of_each(kinds: Mapping[str, np.dtype[Any]]) -> int:
    return sum(kind.itemsize for kind in kinds.values())
