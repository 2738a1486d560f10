"""Solvers: what prepares a sample, and Inspect's own agent on our tools."""

from __future__ import annotations

from typing import Final

from inspect_ai.agent import Agent, AgentAttempts, AgentState, AgentSubmit, as_solver, react
from inspect_ai.model import get_model
from inspect_ai.scorer import Score
from inspect_ai.solver import Generate, Solver, TaskState, solver
from inspect_ai.tool import Tool

from buildarena_inspect.building import Building, begin, building_of
from buildarena_inspect.tools import building_tools, put_numbers_into_texts, submit_tool

MAX_IDLE_TURNS: Final = 10
"""After so many replies in a row without a call that reaches the machine, the building ends."""
GO_ON: Final = "Go on with a tool call; `{submit}` ends the building."
AGAIN: Final = "The trial did not succeed. Build on, and submit again."


@solver
def workbench() -> Solver:
    """Gives a sample a workbench of its own, and its tools to any solver that uses the state's."""

    async def solve(state: TaskState, generate: Generate) -> TaskState:
        del generate
        building = begin(state)
        state.tools = [
            tool.as_tool() for tool in (*building_tools(building), submit_tool(building))
        ]
        return state

    return solve


@solver
def react_builder() -> Solver:
    """Inspect's react agent, with the briefing that external agents read and nothing else."""

    async def solve(state: TaskState, generate: Generate) -> TaskState:
        building = building_of(state)
        agent = react(
            prompt=None,
            model=_replying(building),
            tools=building_tools(building),
            submit=AgentSubmit(tool=submit_tool(building), keep_in_messages=True),
            attempts=AgentAttempts(building.environment.rounds, _again),
            on_continue=_Patience(building),
        )
        return await as_solver(agent)(state, generate)

    return solve


def _replying(building: Building) -> Agent:
    """The evaluated model, whose calls may give blocks' ids as numbers."""

    async def reply(state: AgentState, tools: list[Tool]) -> AgentState:
        output = (await get_model().generate(state.messages, tools)).model_copy(deep=True)
        for call in output.message.tool_calls or ():
            put_numbers_into_texts(call, building.environment.tools)
        state.output = output
        state.messages.append(output.message)
        return state

    return reply


async def _again(state: AgentState, scores: list[Score]) -> str:
    del state, scores  # the tool's answer has told what was measured
    return AGAIN


class _Patience:
    """Lets an agent go on while it builds, and ends one that only talks.

    Args:
        building: What it builds.
    """

    def __init__(self, building: Building) -> None:
        self._building = building
        self._made = 0
        self._idle = 0

    async def __call__(self, state: AgentState) -> bool | str:
        """Whether the agent goes on; a text is sent to it."""
        made = len(self._building.calls) + len(self._building.environment.trials)
        self._idle = 0 if made > self._made else self._idle + 1
        self._made = made
        if self._idle >= MAX_IDLE_TURNS:
            return False
        return True if state.output.message.tool_calls else GO_ON
