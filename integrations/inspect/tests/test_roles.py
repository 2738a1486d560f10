"""Our workflow of five roles on Inspect's models, played by the built-in expert."""

import subprocess
import sys

import pytest
from inspect_ai.model import ChatMessage, ModelOutput
from scripted_models import EXPERTS, only

from buildarena_benchmark.environment import Workbench
from buildarena_geometry import Machine
from buildarena_inspect.scorers import machine_hash

pytestmark = pytest.mark.nightly

expert = pytest.importorskip("buildarena_worker.builtin.expert", reason="needs the extra `roles`")


def five_roles(messages: list[ChatMessage], seed: int = 0) -> ModelOutput:
    """What the built-in expert says in the role that it is asked in."""
    from buildarena_worker.session.messages import Message, Request, ToolCall

    def heard_of(message) -> Message:
        made = getattr(message, "tool_calls", None) or ()
        calls = [ToolCall(id=one.id, name=one.function, arguments=one.arguments) for one in made]
        return Message(role=message.role, text=message.text, calls=calls)

    heard = [heard_of(message) for message in messages]
    reply = expert.reply(Request(model_config={}, messages=heard, seed=seed))
    for made in reply.calls:
        return ModelOutput.for_tool_call("mockllm", made.name, dict(made.arguments))
    return ModelOutput.from_content("mockllm", reply.text)


ROLES = {"solver": "roles", "simulator": "mujoco"}
"""The stored scores are MuJoCo's."""


@pytest.mark.parametrize("task", ["support-1", "lift-3", "transport-1"])
def test_the_workflow_builds_what_it_builds_in_the_service(run, task) -> None:
    log = run(f"buildarena/{task.replace('-', '_')}", five_roles, task_args=ROLES)
    sample = only(log)
    metadata = sample.scores["success"].metadata
    assert metadata["indicator"] == pytest.approx(EXPERTS[task]["score"]["indicator"], rel=0.02)
    roles = [m.metadata["role"] for m in sample.messages if (m.metadata or {}).get("role")]
    assert {"planner", "drafter", "reviewer", "builder", "guidance"} <= set(roles)
    asked = [event for event in sample.events if event.event == "model"]
    assert len(asked) == len(roles)
    assert sample.model_usage["mockllm/model"].total_tokens == 10 * len(roles)


def test_a_tested_drive_that_is_kept_counts_with_its_machine_and_calls(run) -> None:
    sample = only(run("buildarena/transport_1", five_roles, task_args=ROLES))
    metadata = sample.scores["success"].metadata
    assert metadata["trials"] == 2
    told = EXPERTS["transport-1"]["score"]["indicator"]
    assert metadata["indicator"] == pytest.approx(told, rel=0.02)
    kept = Machine.from_document(sample.store["buildarena:machine"])
    bench = Workbench()
    for made in sample.store["buildarena:calls"]:
        bench.act(made["machine"], made["tool"], made["arguments"])
    assert machine_hash(kept) == machine_hash(bench.submitted()) == metadata["machine_hash"]


def test_a_session_that_fails_is_scored_as_one(run) -> None:
    def silent(_: list[ChatMessage]) -> ModelOutput:
        return ModelOutput.from_content("mockllm", "I do not know.")

    sample = only(run("buildarena/support_1", silent, task_args=ROLES))
    metadata = sample.scores["success"].metadata
    assert (sample.scores["success"].value, metadata["indicator"]) == ("I", 0.0)
    assert metadata["reason"]
    assert sample.store["buildarena:calls"] == []


WITHOUT = """
import sys
sys.modules["buildarena_worker"] = None
from buildarena_inspect import TASKS
TASKS["support_1"]()
assert not [name for name in sys.modules if name.startswith(("buildarena_backend", "sqlalchemy"))]
try:
    TASKS["support_1"](solver="roles")
except ValueError as error:
    print(error)
"""


def test_everything_else_does_without_the_extra() -> None:
    words = [sys.executable, "-c", WITHOUT]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert done.stdout.strip().endswith('pip install "buildarena-inspect[roles]"')
