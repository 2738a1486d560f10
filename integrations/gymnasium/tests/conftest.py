"""The built-in expert's calls, as actions."""

from buildarena_geometry import kernels  # noqa: F401 -- before numpy

# isort: split

import json
from pathlib import Path
from typing import Any

import pytest

DATA = Path(__file__).parents[3] / "build/expert_calls.json"
SUBMIT = '{"tool": "submit"}'


@pytest.fixture(scope="session")
def experts() -> dict[str, Any]:
    return json.loads(DATA.read_text())


@pytest.fixture(scope="session")
def actions(experts) -> dict[str, list[str]]:
    """By task, what builds the expert's machine and submits it."""

    def text(made) -> str:
        arguments = {**made["arguments"], "machine": made["machine"]}
        return json.dumps({"tool": made["tool"], "arguments": arguments})

    return {task: [*map(text, one["calls"]), SUBMIT] for task, one in experts.items()}
