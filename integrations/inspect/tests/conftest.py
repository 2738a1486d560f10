"""What the tests of the adapter share: their own folders, and evaluations."""

from buildarena_geometry import kernels  # noqa: F401 -- before numpy

# isort: split

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from inspect_ai import eval as evaluate
from inspect_ai.log import EvalLog

sys.path.insert(0, str(Path(__file__).parent))  # the tests' own modules

from scripted_models import Answer, expert, scripted


def pytest_configure(config: pytest.Config) -> None:
    """Inspect leaves streams open that the interpreter closes."""
    for kind in ("ResourceWarning", "pytest.PytestUnraisableExceptionWarning"):
        config.addinivalue_line("filterwarnings", f"ignore::{kind}")


@pytest.fixture(autouse=True)
def own_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Inspect's own files go where the test's go."""
    monkeypatch.chdir(tmp_path)
    for name in ("XDG_DATA_HOME", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, str(tmp_path / name))
    for name in [name for name in os.environ if name.startswith("INSPECT_")]:
        monkeypatch.delenv(name)


@pytest.fixture
def run(tmp_path: Path) -> Callable[..., EvalLog]:
    """Evaluates a task and gives its log, which must have been written."""

    def run(task: Any, answer: Answer = expert, **more: Any) -> EvalLog:
        more.setdefault("model", scripted(answer))
        (log,) = evaluate(task, log_dir=str(tmp_path / "logs"), display="none", **more)
        return log

    return run
