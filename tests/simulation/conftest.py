"""Fixtures of the simulation tests."""

from typing import Any

import pytest
from support.machines.building import BLOCK, built

from buildarena_benchmark import Task, builtin_tasks
from buildarena_geometry import Machine
from buildarena_simulation import ENGINES
from buildarena_simulation.structure import clusters


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(params=("base", "arm"))
def root(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Which side of a joint the engines see it from: the heavy base, or what hangs on it."""
    heaviest = clusters._root

    def lightest(*arguments: Any) -> int:
        structure, groups, piece, _ = arguments
        return min(piece, key=lambda g: float(structure.masses[groups[g]].sum()))

    monkeypatch.setattr(clusters, "_root", heaviest if request.param == "base" else lightest)
    return str(request.param)


@pytest.fixture
def beam() -> Machine:
    """Two blocks."""
    return built(("1", "E", BLOCK))


@pytest.fixture(scope="session")
def tasks() -> dict[str, Task]:
    return dict(builtin_tasks())
