"""Summaries of cells as rows keep them: what they say, and the samples that tests are made of."""

from __future__ import annotations

from buildarena_geometry import kernels  # noqa: F401 - before numpy

# isort: split

from collections.abc import Collection, Mapping
from datetime import datetime
from typing import Any, Final

import numpy as np

from buildarena_benchmark.flags import ScoringPolicy
from buildarena_benchmark.leaderboard import Cell, CellName
from buildarena_benchmark.statistics import Sample

_OF_CELL: Final = frozenset(CellName.__dataclass_fields__)
_ELSEWHERE: Final = _OF_CELL | {"sample", "figures_hash", "newest"}
_SAID: Final = tuple(name for name in Cell.__dataclass_fields__ if name not in _ELSEWHERE)
"""Fields of a summary that rows keep as they are."""
_COLUMNS: Final = 3
"""Of a sample: success, indicator, how many trials."""


def pack_summaries(summaries: Mapping[ScoringPolicy, Cell]) -> tuple[dict[str, Any], bytes]:
    """What a cell's summaries say by scoring policy, and their samples, one after another."""
    said: dict[str, Any] = {}
    samples = []
    for policy, cell in summaries.items():
        said[policy] = {name: getattr(cell, name) for name in _SAID} | {
            "newest": cell.newest.isoformat() if cell.newest else None,
            "figures_hash": cell.figures_hash.hex(),
            "distinct": len(cell.sample.times),
        }
        samples.append(np.column_stack([cell.sample.figures, cell.sample.times]).tobytes())
    return said, b"".join(samples)


def unpack_summaries(
    name: CellName,
    said: Mapping[str, Any] | None,
    samples: bytes,
    policies: Collection[ScoringPolicy],
) -> dict[ScoringPolicy, Cell]:
    """A row's summaries under some scoring policies; none of a row that has none."""
    summaries, start = {}, 0
    for policy, one in (said or {}).items():
        values = one["distinct"] * _COLUMNS
        if policy in policies:
            columns = np.frombuffer(samples, np.float64, values, start).reshape(-1, _COLUMNS)
            newest = one["newest"]
            summaries[ScoringPolicy(policy)] = Cell(
                **{field: getattr(name, field) for field in _OF_CELL},
                **{field: one[field] for field in _SAID},
                newest=datetime.fromisoformat(newest) if newest else None,
                figures_hash=bytes.fromhex(one["figures_hash"]),
                sample=Sample(figures=columns[:, :2].copy(), times=columns[:, 2].copy()),
            )
        start += values * np.dtype(np.float64).itemsize
    return summaries
