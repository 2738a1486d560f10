"""Host of a session of BuildArena's workflow inside Inspect.

A session is plain code in a thread. It calls Inspect's models on the event loop and waits for them;
its machines are simulated by the processes that all samples share.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Final

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
from inspect_ai.tool import ToolInfo

from buildarena_backend.journal.journal import Usage
from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_backend.trials.trial_repository import tracked_at_1_hz
from buildarena_benchmark.environment import Trial
from buildarena_geometry import KeyPress, Machine
from buildarena_inspect.building import Building, try_machine
from buildarena_inspect.scorers import machine_hash
from buildarena_inspect.tools import parameters_of
from buildarena_simulation import Trajectory
from buildarena_worker.session.messages import Completion, Message, Request, ToolCall

FINISHES: Final = {
    "max_tokens": "length",
    "model_length": "context_overflow",
    "tool_calls": "tool_call",
    "content_filter": "content_filter",
}
"""Finish reasons by Inspect's stop reasons; all others are ordinary ends."""


class RoleHost:
    """Source of a session's replies, from Inspect's models, and trials.

    Attributes:
        output: Last output of a model.
    """

    def __init__(self, building: Building) -> None:
        self._building = building
        self._replies: dict[tuple[str, ...], ChatMessageAssistant] = {}
        self.output: ModelOutput | None = None

    def ask(self, request: Request) -> Completion:
        """Return the model's reply to a request."""
        started = time.monotonic()
        output = anyio.from_thread.run(self._generate, request)
        self.output = output
        completion = _completion(output, time.monotonic() - started)
        self._replies[_key(completion.text, completion.calls)] = output.message
        return completion

    def simulate(
        self, machine: Machine, controls: Sequence[KeyPress] | None, *, final: bool
    ) -> RolloutRecord:
        """Return the result of simulating the machine, which includes its key presses.

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
        """Return the trajectory of a rollout; None if its machine could not be simulated."""
        return self._building.environment.trials[record.number].trajectory

    async def _generate(self, request: Request) -> ModelOutput:
        return await get_model(role=request.role).generate(
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
            # Unchanged, because some providers require their reasoning in it.
            reply = self._replies.get(_key(message.text, message.calls))
            return reply or ChatMessageAssistant(content=message.text)
        return ChatMessageUser(content=message.text)


def _key(text: str, calls: Sequence[ToolCall]) -> tuple[str, ...]:
    return tuple(call.id for call in calls) or (text,)


def _completion(output: ModelOutput, latency_s: float) -> Completion:
    message = output.message
    return Completion(
        text=message.text,
        calls=tuple(
            # The error text replaces arguments that could not be parsed.
            ToolCall(id=call.id, name=call.function, arguments=call.parse_error or call.arguments)
            for call in message.tool_calls or ()
        ),
        finish=FINISHES.get(output.stop_reason, "stop"),
        usage=_usage(output),
        latency_s=latency_s,
    )


def _usage(output: ModelOutput) -> Usage:
    used = output.usage
    if used is None:
        return Usage()
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
