"""Solvers: the preparation of a sample, and Inspect's agent with the building tools."""

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
"""Consecutive replies without a call that reaches the machine, after which the building ends."""
GO_ON: Final = "Go on with a tool call; `{submit}` ends the building."
AGAIN: Final = "The trial did not succeed. Build on, and submit again."


@solver
def workbench() -> Solver:
    """Give a sample its workbench, and the tools to solvers that use the state's."""

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
    """Run Inspect's react agent, with only the briefing of external agents."""

    async def solve(state: TaskState, generate: Generate) -> TaskState:
        building = building_of(state)
        agent = react(
            prompt=None,
            model=_model_agent(building),
            tools=building_tools(building),
            submit=AgentSubmit(tool=submit_tool(building), keep_in_messages=True),
            attempts=AgentAttempts(building.environment.rounds, _again),
            on_continue=_Patience(building),
        )
        return await as_solver(agent)(state, generate)

    return solve


def _model_agent(building: Building) -> Agent:
    """Return the evaluated model as an agent, whose calls may have blocks' ids as numbers."""

    async def reply(state: AgentState, tools: list[Tool]) -> AgentState:
        output = (await get_model().generate(state.messages, tools)).model_copy(deep=True)
        for call in output.message.tool_calls or ():
            put_numbers_into_texts(call, building.environment.tools)
        state.output = output
        state.messages.append(output.message)
        return state

    return reply


async def _again(state: AgentState, scores: list[Score]) -> str:
    del state, scores  # the tool's answer contains the measurements
    return AGAIN


class _Patience:
    """Callback that lets an agent continue while it builds, and ends one that only talks."""

    def __init__(self, building: Building) -> None:
        self._building = building
        self._actions = 0
        self._idle = 0

    async def __call__(self, state: AgentState) -> bool | str:
        """Return whether the agent continues, or a text that it receives."""
        actions = len(self._building.calls) + len(self._building.environment.trials)
        self._idle = 0 if actions > self._actions else self._idle + 1
        self._actions = actions
        if self._idle >= MAX_IDLE_TURNS:
            return False
        return True if state.output.message.tool_calls else GO_ON
