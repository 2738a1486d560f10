"""Tallies and their details as rows keep them: what is said once, and the figures of each trial."""

from __future__ import annotations

from buildarena_geometry import kernels  # noqa: F401 - before numpy

# isort: split

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from datetime import datetime
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
    figures = [
        getattr(tally, name).astype(kind).tobytes()
        for tally in tallies
        for name, kind in _FIGURES.items()
    ]
    return said, b"".join(figures)


def pack_details(details: Sequence[Details]) -> bytes:
    """The details of all tallies of a row."""
    parts = []
    for one in details:
        parts += [getattr(one, name).astype(kind) for name, kind in _DETAILS.items()]
        parts += [times.astype(_INTEGERS) for _, times in sorted(one.refusals.items())]
    return b"".join(part.tobytes() for part in parts)


def unpack_tallies(said: Sequence[Mapping[str, Any]], figures: bytes) -> list[Tally]:
    """The tallies of a row."""
    tallies, start = [], 0
    for one in said:
        kinds = list(_FIGURES.values())
        arrays = _arrays(figures, start, one["number"], kinds)
        start += one["number"] * sum(kind.itemsize for kind in kinds)
        tallies.append(
            Tally(
                **dict(zip(_FIGURES, arrays, strict=True)),
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
    details, start = [], 0
    for one in said:
        classes = sorted(one["refusals"])
        kinds = [*_DETAILS.values(), *[_INTEGERS] * len(classes)]
        arrays = list(_arrays(data, start, one["number"], kinds))
        start += one["number"] * sum(kind.itemsize for kind in kinds)
        own, refusals = arrays[: len(_DETAILS)], arrays[len(_DETAILS) :]
        details.append(
            Details(
                **dict(zip(_DETAILS, own, strict=True)),
                refusals=dict(zip(classes, refusals, strict=True)),
            )
        )
    return details


def _arrays(
    data: bytes, start: int, number: int, kinds: Sequence[np.dtype[Any]]
) -> Iterator[NDArray[Any]]:
    """Arrays of a number of values each, one after another."""
    for kind in kinds:
        values = np.frombuffer(data, kind, number, start)
        yield values.astype(np.float64 if kind == _FLOATS else np.int64)
        start += number * kind.itemsize
