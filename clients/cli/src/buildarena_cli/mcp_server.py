"""The MCP server: any agent that speaks the Model Context Protocol can build, submit and be scored.

It is a thin client of the tools API. Each tool of the geometry library is offered with two more
arguments: the session, and the sub-structure it is meant for.
"""

from __future__ import annotations

import asyncio
import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import Any, Final

from mcp import types
from mcp.server import Server, ServerRequestContext
from mcp.server.stdio import stdio_server

from buildarena_benchmark.environment import MAIN
from buildarena_benchmark.environment.tools import MACHINE, building_tools
from buildarena_cli.errors import CommandError, explain
from buildarena_cli.ids import checked_id
from buildarena_client.client import Client
from buildarena_client.errors import ClientError
from buildarena_geometry.modules.names import CaselessNames

INSTRUCTIONS = """Build a machine for a BuildArena task. Call list_tasks, then open_session for one
task; read its answer: the task, the rules and the modules; call start and the other tools with the
session's id until the machine is finished; then call submit, and get_result until the job has
ended. Calls of a session are carried out one at a time, in the order in which they arrive."""
SESSION = {
    "session": {"type": "string", "description": "Id that open_session gave."},
    "machine": {**MACHINE, "description": "Sub-structure; a new name begins a new one."},
}

Arguments = Mapping[str, Any]
EVERY_TOOL: Final = building_tools()


def make_server(client: Client) -> Server[Any]:
    """Return the server on top of the API."""
    machine_tools = CaselessNames(tool.name for tool in EVERY_TOOL)
    # Threads would carry out calls that were sent side by side in any order.
    turns: defaultdict[object, asyncio.Lock] = defaultdict(asyncio.Lock)

    async def list_tools(
        _: ServerRequestContext[Any], __: types.PaginatedRequestParams | None
    ) -> types.ListToolsResult:
        simulators = (await asyncio.to_thread(client.get, "/v1/simulators"))["data"]
        return types.ListToolsResult(tools=_tools(simulators))

    async def call_tool(
        _: ServerRequestContext[Any], params: types.CallToolRequestParams
    ) -> types.CallToolResult:
        arguments = dict(params.arguments or {})
        tool = machine_tools.find(params.name)
        try:
            if tool is not None:
                async with turns[str(arguments.get("session"))]:
                    answer = await asyncio.to_thread(_act, client, tool, arguments)
            else:
                answer = await asyncio.to_thread(_manage, client, params.name, arguments)
        except KeyError as error:
            return _result(f"missing argument {error}", failed=True)
        except ClientError as error:
            return _result(explain(error), failed=True)
        except CommandError as error:
            return _result(str(error), failed=True)
        return answer

    return Server(
        "buildarena",
        version=version("buildarena"),
        instructions=INSTRUCTIONS,
        on_list_tools=list_tools,
        on_call_tool=call_tool,
    )


async def serve_stdio(client: Client) -> None:
    """Serve one agent over standard input and output."""
    server = make_server(client)
    async with stdio_server() as (read, write):
        await server.run(read, write, server.create_initialization_options())


def _tools(simulators: Sequence[Mapping[str, Any]]) -> list[types.Tool]:
    simulator: dict[str, Any] = {
        "type": "string",
        "enum": [entry["name"] for entry in simulators],
        "description": "What simulates the machine.",
    }
    simulator.update(("default", entry["name"]) for entry in simulators if entry["default"])
    opening = {
        "task": {"type": "string", "description": "A name that list_tasks gave."},
        "agent": {
            "type": "string",
            "description": "Your name on the leaderboard: letters, digits, dots, dashes and "
            "underscores.",
        },
        "seed": {
            "type": "integer",
            "minimum": 0,
            "default": 0,
            "description": "Each seed is one try at the task.",
        },
        "simulator": simulator,
    }
    of_session = {"session": SESSION["session"]}
    managing = [
        _tool("list_tasks", "List the tasks with their titles.", {}, []),
        _tool(
            "open_session",
            "Begin to build for a task; answers with the session's id, the task, the rules and the "
            "modules. Called again with the same arguments, it gives the same session for as long "
            "as that is open.",
            opening,
            ["task", "agent"],
        ),
        _tool(
            "test",
            "Have the machine tried as it stands, where the task has test trials; get_result tells "
            "what was measured, and the session goes on. It counts for nothing.",
            of_session,
        ),
        _tool("submit", "End the building; the machine is simulated and scored.", of_session),
        _tool("get_result", "Read how the session's job ended, or where it is.", of_session),
    ]
    # Sessions of tasks with inline modules refuse lookups, those that take keys alone programs.
    building = [
        _tool(
            tool.name,
            tool.description,
            {**SESSION, **tool.parameters.get("properties", {})},
            ["session", *tool.parameters.get("required", [])],
        )
        for tool in EVERY_TOOL
    ]
    return managing + building


def _tool(
    name: str, description: str, properties: Arguments, required: Sequence[str] = ("session",)
) -> types.Tool:
    schema = {"type": "object", "properties": dict(properties), "required": list(required)}
    return types.Tool(name=name, description=description, input_schema=schema)


def _act(client: Client, tool: str, arguments: dict[str, Any]) -> types.CallToolResult:
    session, machine = checked_id("job", arguments.pop("session")), arguments.pop("machine", MAIN)
    done = client.call_tool(session, tool, arguments, machine=machine)
    return _result(done["feedback"], failed=not done["ok"])


def _manage(client: Client, tool: str, arguments: Arguments) -> types.CallToolResult:
    if tool == "list_tasks":
        tasks = client.tasks()
        return _result("\n".join(f"{task['name']}: {task['title']}" for task in tasks))
    if tool == "open_session":
        return _result(_opened(client.post("/v1/sessions", arguments)))
    if tool not in ("test", "submit", "get_result"):
        return _result(f"there is no tool {tool!r}", failed=True)
    session = checked_id("job", arguments["session"])
    if tool == "test":
        return _result(_ended(client.test_session(session)))
    if tool == "submit":
        return _result(_ended(client.submit_session(session)))
    job = client.job(session)
    tests = client.session(session)["test_trials"] if job["outcome"] is None else []
    return _result("\n\n".join([_ended(job), *map(_tested, tests)]))


def _opened(session: Mapping[str, Any]) -> str:
    again = (
        f"It was open already, and {session['calls']} calls were made; get_machine_summary tells "
        "what is built."
    )
    lines = [f"session: {session['id']}", *([again] if session["calls"] else [])]
    return "\n\n".join([*lines, session["briefing"]])


def _tested(test: Mapping[str, Any]) -> str:
    if test["result"] is None:
        return f"Test trial {test['number']} is under way."
    rows = "\n".join(", ".join(f"{value:.2f}" for value in row) for row in test["trace"])
    heading = "Positions of what counts, each second (time, x, y, z):"
    return f"Test trial {test['number']}: {test['result']}\n{heading}\n{rows}"


def _ended(job: Mapping[str, Any]) -> str:
    if job["outcome"] is None:
        return f"not ended yet: {job['stage']} {job['state']}"
    names = ("outcome", "reason", "detail", "success", "indicator", "flags", "metrics")
    worlds = [
        f"{'Exact' if world['exact'] else 'Varied'} world: "
        f"{'passed' if world['success'] else 'failed'}. {world['explanation']}"
        for world in job.get("worlds", ())
    ]
    return json.dumps({**{name: job[name] for name in names}, "worlds": worlds})


def _result(text: str, *, failed: bool = False) -> types.CallToolResult:
    return types.CallToolResult(
        content=[types.TextContent(type="text", text=text)], is_error=failed
    )
