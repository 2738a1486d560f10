"""What is built again and again: the expert's bridge, as calls and as a machine."""

from typing import Any

import pytest
from support.machines import expert_calls
from support.machines.expert_calls import played

from buildarena_benchmark.environment import Environment
from buildarena_benchmark.environment.expert_calls import Call
from buildarena_geometry import Machine


@pytest.fixture(scope="session")
def experts() -> dict[str, Any]:
    return expert_calls.Experts()


@pytest.fixture(scope="session")
def bridge_calls(experts) -> list[Call]:
    return experts["support-1"]["calls"]


@pytest.fixture
def bridge(bridge_calls) -> Machine:
    return played(Environment("support-1"), bridge_calls).machines["main"]
