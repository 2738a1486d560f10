from collections.abc import Callable
from datetime import UTC, datetime

import pytest

from buildarena_backend.journal.rollouts import RolloutRecord


@pytest.fixture
def rollout() -> Callable[..., RolloutRecord]:
    """Makes a finished rollout."""

    def make(number: int = 0, *, success: bool = True, indicator: float = 11.0) -> RolloutRecord:
        now = datetime.now(UTC)
        figures = {"success": success, "indicator": indicator, "metrics": {}, "flags": []}
        tried = {"engine": "pybullet", "machine_hash": "0" * 64, "controls": None, "final": False}
        kept = {"trajectory_hash": None, "trace": [[0.0, 0.0, 0.0, 1.0], [1.0, 2.0, 0.0, 1.0]]}
        ran = {"versions": {}, "wall_s": 0.1, "created_at": now, "finished_at": now}
        return RolloutRecord(number=number, **figures, **tried, **kept, **ran)

    return make
