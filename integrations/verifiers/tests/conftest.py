"""The built-in expert's calls as a model makes them, and a place for verifiers' files."""

from buildarena_geometry import kernels  # noqa: F401 -- before numpy

# isort: split

import json
import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))

DATA = Path(__file__).parents[3] / "build/expert_calls.json"
SUBMIT = {"tool": "submit", "arguments": {}}


@pytest.fixture(scope="session")
def experts() -> dict[str, Any]:
    return json.loads(DATA.read_text())


@pytest.fixture(scope="session")
def scripts(experts) -> dict[str, list[dict[str, Any]]]:
    """By task, what builds the expert's machine; without the submission."""

    def call(made):
        arguments = {**made["arguments"], "machine": made["machine"]}
        return {"tool": made["tool"], "arguments": arguments}

    return {task: [call(made) for made in expert["calls"]] for task, expert in experts.items()}


def without(script: list[dict[str, Any]], *places: int) -> list[dict[str, Any]]:
    """The script with some calls left out, and submitted."""
    return [*(call for place, call in enumerate(script) if place not in places), SUBMIT]
