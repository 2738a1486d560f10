"""Fixtures of the simulation tests."""

import sys
from pathlib import Path

import pytest

from buildarena_benchmark import Task, builtin_tasks
from buildarena_simulation import ENGINES

# The reference designs are a module of this folder, shared with the benchmarks.
sys.path.insert(0, str(Path(__file__).parents[2]))


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="session")
def tasks() -> dict[str, Task]:
    return dict(builtin_tasks())
