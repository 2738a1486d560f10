"""The loop between model and episode, in this process: every model call goes to the endpoint."""

from __future__ import annotations

from typing import Any

import verifiers.v1 as vf
from openai import AsyncOpenAI

from buildarena_verifiers.harness_config import BuildHarnessConfig
from buildarena_verifiers.rollout import Seat
from buildarena_verifiers.taskset import seat_of

MAX_REMINDERS = 3
"""Consecutive replies without a tool call that are allowed; the next one ends the building."""
REMINDER = "Call a tool, or call `submit` when your machine is finished."


class BuildHarness(vf.Harness[BuildHarnessConfig]):
    """Harness that gives a model the building tools until its episode ends or it stops using them.

    It starts no program: an action takes less than a millisecond, and machines are simulated in
    processes that all rollouts share.
    """

    APPENDS_SYSTEM_PROMPT = True
    EXECUTES_CODE = False
    NEEDS_CONTAINER = False

    async def launch(  # noqa: PLR0917 - the framework's signature
        self,
        ctx: vf.ModelContext,
        trace: vf.Trace[Any, Any, Any],
        runtime: vf.Runtime,  # noqa: ARG002 - the framework's signature
        endpoint: str,
        secret: str,
        mcp_urls: dict[str, str],  # noqa: ARG002 - the framework's signature
        data: vf.TaskData,
    ) -> vf.ProgramResult:
        """Play a rollout.

        Raises:
            TypeError: The rollout is of another taskset.
            SimulationError: The simulator failed, which costs this rollout.
        """
        system, prompt = self.resolve_text_prompt(data)
        messages: list[Any] = [{"role": "user", "content": prompt or ""}]
        if system:
            messages.insert(0, {"role": "system", "content": system})
        async with AsyncOpenAI(base_url=endpoint, api_key=secret, timeout=None) as client:
            await _play(client, ctx.model, messages, seat_of(trace))
        return vf.ProgramResult(exit_code=0, stdout="", stderr="")


async def _play(client: AsyncOpenAI, model: str, messages: list[Any], seat: Seat) -> None:
    tools: Any = seat.tools
    reminders = 0
    while not seat.environment.done:
        completion = await client.chat.completions.create(
            model=model, messages=messages, tools=tools
        )
        reply = completion.choices[0].message
        messages.append(reply.model_dump(exclude_none=True))
        if not reply.tool_calls:
            reminders += 1
            if reminders > MAX_REMINDERS:
                return
            messages.append({"role": "user", "content": REMINDER})
            continue
        reminders = 0
        messages += await _answers(reply.tool_calls, seat)


async def _answers(calls: list[Any], seat: Seat) -> list[dict[str, str]]:
    """Return the answers to a reply's calls in order, until the episode ends."""
    answers = []
    for call in calls:
        if seat.environment.done:
            break
        if call.type == "function":
            answer = await seat.call(call.function.name, call.function.arguments)
        else:
            answer = await seat.call(call.type, "")
        answers.append({"role": "tool", "tool_call_id": call.id, "content": answer.text})
    return answers
