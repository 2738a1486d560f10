"""Summaries of cells as rows keep them: what they say, and the samples that tests are made of."""

from __future__ import annotations

from buildarena_geometry import kernels  # noqa: F401 - before numpy

# isort: split

from collections.abc import Mapping
from datetime import datetime
from typing import Any, Final

import numpy as np

from buildarena_benchmark.leaderboard import Cell, CellName
from buildarena_benchmark.statistics import Sample

_OF_CELL: Final = frozenset(CellName.__dataclass_fields__)
_ELSEWHERE: Final = _OF_CELL | {"sample", "figures_hash", "newest"}
_SAID: Final = tuple(name for name in Cell.__dataclass_fields__ if name not in _ELSEWHERE)
"""Fields of a summary that rows keep as they are."""
_COLUMNS: Final = 3
"""Of a sample: success, indicator, how many trials."""


def pack_summary(cell: Cell | None) -> tuple[dict[str, Any] | None, bytes]:
    """What a cell's summary says, and its sample; nothing of a cell without one."""
    if cell is None:
        return None, b""
    said = {name: getattr(cell, name) for name in _SAID} | {
        "newest": cell.newest.isoformat() if cell.newest else None,
        "figures_hash": cell.figures_hash.hex(),
    }
    return said, np.column_stack([cell.sample.figures, cell.sample.times]).tobytes()


def unpack_summary(name: CellName, said: Mapping[str, Any] | None, samples: bytes) -> Cell | None:
    """A row's summary; None of a row that has none."""
    if not said:
        return None
    columns = np.frombuffer(samples, np.float64).reshape(-1, _COLUMNS)
    newest = said["newest"]
    return Cell(
        **{field: getattr(name, field) for field in _OF_CELL},
        **{field: said[field] for field in _SAID},
        newest=datetime.fromisoformat(newest) if newest else None,
        figures_hash=bytes.fromhex(said["figures_hash"]),
        sample=Sample(figures=columns[:, :2].copy(), times=columns[:, 2].copy()),
    )
