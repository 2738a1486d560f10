"""Where a session of our workflow gets its answers from, inside Inspect.

A session is plain code in a thread. It asks Inspect's models on the event loop and waits there; its
machines are tried in that thread, by the processes that try all others.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Final

import anyio.from_thread
from inspect_ai.model import (
    ChatMessage,
    ChatMessageAssistant,
    ChatMessageSystem,
    ChatMessageTool,
    ChatMessageUser,
    ModelOutput,
    get_model,
)
from inspect_ai.tool import ToolCall as InspectCall
from inspect_ai.tool import ToolInfo

from buildarena_backend.journal.journal import Usage
from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_backend.trials.trial_repository import tracked_at_1_hz
from buildarena_inspect.building import Building
from buildarena_inspect.scorers import machine_hash
from buildarena_inspect.tools import parameters_of
from buildarena_inspect.trial_processes import try_machine
from buildarena_worker.session.messages import Completion, Message, Request, ToolCall

if TYPE_CHECKING:
    from buildarena_benchmark.environment import Trial
    from buildarena_geometry import KeyPress, Machine
    from buildarena_simulation import Trajectory

FINISHES: Final = {
    "max_tokens": "length",
    "model_length": "context_overflow",
    "tool_calls": "tool_call",
    "content_filter": "content_filter",
}
"""Why a model stopped, in our words; everything else is an ordinary end."""
NO_COST: Final = Usage()


class RoleHost:
    """Gives a session the answers of Inspect's models, and trials.

    Args:
        building: What is built.

    Attributes:
        output: What a model answered last.
    """

    def __init__(self, building: Building) -> None:
        self._building = building
        self._said: dict[tuple[str, ...], ChatMessageAssistant] = {}
        self.output: ModelOutput | None = None

    def ask(self, request: Request, *, phase: str, role: str) -> Completion:
        """The model's reply to a request."""
        del phase
        started = time.monotonic()
        output = anyio.from_thread.run(self._generated, request, role)
        self.output = output
        completion = _completion(output, time.monotonic() - started)
        self._said[_key(completion.text, completion.calls)] = output.message
        return completion

    def simulate(
        self, machine: Machine, controls: Sequence[KeyPress] | None, *, final: bool
    ) -> RolloutRecord:
        """The result of simulating the machine, whose key presses stand in it.

        Raises:
            SimulationError: The engine failed or crashed.
        """
        del controls  # a copy of the machine's own
        building = self._building
        environment = building.environment
        trial = try_machine(environment.task, machine, environment.simulator, seed=environment.seed)
        building.adopt(machine, trial)
        number = len(environment.trials) - 1
        return _record(trial, number, environment.simulator, machine_hash(machine), final=final)

    def trajectory(self, record: RolloutRecord) -> Trajectory | None:
        """The trajectory of a rollout; None when its machine could not be simulated."""
        return self._building.environment.trials[record.number].trajectory

    async def _generated(self, request: Request, role: str) -> ModelOutput:
        return await get_model(role=role).generate(
            [self._message(message) for message in request.messages],
            tools=[
                ToolInfo(
                    name=tool.name,
                    description=tool.description,
                    parameters=parameters_of(tool.parameters),
                )
                for tool in request.tools
            ],
        )

    def _message(self, message: Message) -> ChatMessage:
        if message.role == "system":
            return ChatMessageSystem(content=message.text)
        if message.role == "tool":
            return ChatMessageTool(
                content=message.text, tool_call_id=message.call_id, function=message.tool
            )
        if message.role == "assistant":
            # As it came: some providers want their reasoning back with it.
            said = self._said.get(_key(message.text, message.calls))
            return said or ChatMessageAssistant(content=message.text)
        return ChatMessageUser(content=message.text)


def _key(text: str, calls: Sequence[ToolCall]) -> tuple[str, ...]:
    return tuple(call.id for call in calls) or (text,)


def _completion(output: ModelOutput, latency_s: float) -> Completion:
    message = output.message
    return Completion(
        text=message.text,
        calls=tuple(
            ToolCall(id=call.id, name=call.function, arguments=_arguments(call))
            for call in message.tool_calls or ()
        ),
        finish=FINISHES.get(output.stop_reason, "stop"),
        usage=_usage(output),
        latency_s=latency_s,
    )


def _arguments(call: InspectCall) -> Any:
    """The arguments; text that is refused where they could not be read."""
    return call.arguments if call.parse_error is None else call.parse_error


def _usage(output: ModelOutput) -> Usage:
    used = output.usage
    if used is None:
        return NO_COST
    return Usage(requests=1, input_tokens=used.input_tokens, output_tokens=used.output_tokens)


def _record(trial: Trial, number: int, engine: str, digest: str, *, final: bool) -> RolloutRecord:
    now = datetime.now(UTC)
    return RolloutRecord(
        number=number,
        final=final,
        engine=engine,
        machine_hash=digest,
        controls=None,
        success=trial.score.success,
        indicator=trial.score.indicator,
        metrics=trial.score.metrics,
        flags=trial.score.flags,
        trajectory_hash=None,
        trace=None if trial.trajectory is None else tracked_at_1_hz(trial.trajectory),
        versions=None,
        wall_s=trial.wall_s if math.isfinite(trial.wall_s) else None,
        created_at=now,
        finished_at=now,
    )
