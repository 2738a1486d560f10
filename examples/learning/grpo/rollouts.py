"""Rollouts through verifiers: the environment plays the policy's endpoint, and says the reward."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import verifiers.v1 as vf
from chat_server import serving
from languages import Call, Said
from network import Writer

from buildarena_geometry.json_texts import read_json
from buildarena_verifiers import BuildEnv, load_environment


@dataclass(frozen=True, slots=True, kw_only=True)
class Rollout:
    """A rollout that has ended.

    Attributes:
        words: Its conversation, from the end of the opening.
        own: Which of the words the policy wrote.
        reward: The environment's.
        success: Whether the task's criterion was met.
        refused: Calls that the environment refused.
    """

    words: list[str]
    own: list[bool]
    reward: float
    success: bool
    refused: int


class RolloutError(Exception):
    """A rollout has no reward, because something of the infrastructure failed."""


class Player:
    """Plays rows of an environment by a policy.

    Args:
        environment: It is being served.
        writer: The policy.
        url: Where it answers.
    """

    def __init__(self, environment: BuildEnv, writer: Writer, url: str) -> None:
        self.environment = environment
        self.writer = writer
        self._client = vf.EvalClientConfig(base_url=url)
        self._rows = list(environment.taskset)

    async def play(
        self, rows: Sequence[int], *, rollouts: int, seed: Sequence[int]
    ) -> list[list[Rollout]]:
        """A group of rollouts of each row; the same seed gives the same ones.

        Raises:
            RolloutError: One has no reward.
        """
        slots = [
            (slot, _number([*seed, row, number]))
            for row in rows
            for number, slot in enumerate(self.environment.slots(self._rows[row], rollouts))
        ]
        episodes = await asyncio.gather(
            *(self.environment.run_slot(slot, self._context(own)) for slot, own in slots)
        )
        ended = [self._rollout(trace) for episode in episodes for trace in episode.traces]
        return [ended[place : place + rollouts] for place in range(0, len(ended), rollouts)]

    def _context(self, seed: int) -> vf.ModelContext:
        sampling = vf.SamplingConfig.model_validate({"seed": seed})
        return vf.ModelContext(client=self._client, model="small-policy", sampling=sampling)

    def _rollout(self, trace: vf.Trace[Any, Any, Any]) -> Rollout:
        if not trace.ok:
            raise RolloutError(f"a rollout failed: {trace.last_error}")
        words, own = self.writer.language.read([_said(node.message) for node in trace.nodes])
        record = trace.info["buildarena"]
        return Rollout(
            words=words,
            own=own,
            reward=trace.reward,
            success=record["rewards"]["success"] == 1,
            refused=record["refused"],
        )


def _number(seed: Sequence[int]) -> int:
    """A seed as one number, which OpenAI's protocol has room for."""
    return int(np.random.SeedSequence(seed).generate_state(1)[0])


def _said(message: Any) -> Said:
    calls = getattr(message, "tool_calls", None) or ()
    return Said(
        role=message.role,
        calls=tuple(Call(call.name, read_json(call.arguments)) for call in calls),
        text=message.content if isinstance(message.content, str) else "",
    )


@contextmanager
def player(
    writer: Writer, *, start_seeds: Sequence[int], simulator: str, processes: int
) -> Iterator[Player]:
    """A player of a task's rows, one for each start; the indicator alone is rewarded."""
    environment = load_environment(
        writer.language.task,
        simulator,
        rewards={"indicator": 1.0},
        processes=processes,
        until_decided=True,
        start_seeds=list(start_seeds),
    )
    with serving(writer) as url:
        yield Player(environment, writer, url)
