"""An MCP client that knows how machines work and no name that the server did not tell it.

It finds tools and arguments by what their descriptions say, modules and their actions in the reply
to the opened session, faces by the side they look to, keys in the schemas. So a name that the
server leaves out makes it fail, as it makes a model guess.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from mcp import ClientSession

_MODULE = re.compile(r"^- (?P<name>[^(\n]+) \((?P<facts>[^)]*)\): (?P<about>.*)$", re.MULTILINE)
_FACE = re.compile(r"([A-Z]) <([^>]*)>")
_BLOCK = re.compile(r"^(?:Started|Attached)\. (\d+) ", re.MULTILINE)


class RefusedError(AssertionError):
    """A call was refused: something was named that does not exist, or is not allowed."""


class Newcomer:
    """Plays one session."""

    def __init__(self, session: ClientSession, tools: Mapping[str, Any]) -> None:
        self._session = session
        self._tools = tools
        self._modules: dict[str, tuple[str, str]] = {}
        self._faces: dict[tuple[str, str], dict[str, str]] = {}
        self.id = ""
        self.machine = ""
        self.calls = 0

    @classmethod
    async def met(cls, session: ClientSession) -> Newcomer:
        """One that has read the server's list of tools."""
        tools = (await session.list_tools()).tools
        return cls(session, {tool.name: tool for tool in tools})

    async def use(self, tool: str, arguments: Mapping[str, Any]) -> str:
        """Uses the tool whose description says this, with arguments by what theirs say.

        Raises:
            RefusedError: It was refused.
        """
        found = self._tool(tool)
        named = {self._argument(found, says): value for says, value in arguments.items()}
        properties = found.input_schema["properties"]
        if self.id and "session" in properties:
            named[self._argument(found, "Id that open_session gave")] = self.id
        if self.machine and any(
            "Sub-structure it is meant" in p["description"] for p in properties.values()
        ):
            named[self._argument(found, "Sub-structure it is meant")] = self.machine
        result = await self._session.call_tool(found.name, named)
        self.calls += 1
        text: str = result.content[0].text
        if result.is_error:
            raise RefusedError(f"{found.name}({named}): {text}")
        self._read_faces(text)
        return text

    async def open(self, title: str, *, simulator: int) -> str:
        """Opens a session for the first task with this in its title; the reply."""
        tasks = await self.use("List the tasks", {})
        task, *_ = re.findall(rf"^(\S+): .*{title}.*$", tasks, re.MULTILINE)
        opening = self._tool("Begin to build")
        simulators = opening.input_schema["properties"][self._argument(opening, "simulates")][
            "enum"
        ]
        reply = await self.use(
            "Begin to build",
            {
                "list_tasks gave": task,
                "leaderboard": "newcomer",
                "simulates": simulators[simulator],
            },
        )
        (self.id,) = re.findall(r"^session: (\S+)$", reply, re.MULTILINE)
        self._modules = {m["name"]: (m["facts"], m["about"]) for m in _MODULE.finditer(reply)}
        return reply

    def module(self, says: str) -> str:
        """The module whose description says this."""
        (name,) = [name for name, (_, about) in self._modules.items() if says in about]
        return name

    def action(self, module: str, says: str) -> str:
        """The action of a module that has this in its name."""
        facts, _ = self._modules[module]
        actions = facts.partition("actions ")[2].split(", ")
        (name,) = [action for action in actions if says in action]
        return name

    def keys(self) -> list[str]:
        """The keys that can be bound."""
        tool = self._tool("Binds a key to an action of a block, in place")
        keys: list[str] = tool.input_schema["properties"][self._argument(tool, "The key")]["enum"]
        return keys

    def face(self, block: str, side: str) -> str:
        """The letter of a block's face that looks to a side."""
        return self._faces[self.machine, block][side]

    async def start(self) -> str:
        """Begins the machine; its first block."""
        return _id(await self.use("Begins the machine", {}))

    async def attach(self, base: str, side: str, module: str) -> tuple[str, str]:
        """Attaches a module to a side of a block; the new block and the answer."""
        text = await self.use(
            "Attaches a new block",
            {"carries the new one": base, "Label of": self.face(base, side), "the module": module},
        )
        return _id(text), text

    async def row(self, base: str, side: str, count: int, module: str) -> list[str]:
        """Attaches so many blocks one after another; the blocks."""
        blocks = []
        for _ in range(count):
            base, _ = await self.attach(base, side, module)
            blocks.append(base)
        return blocks

    async def join(self, first: tuple[str, str], second: tuple[str, str], connector: str) -> None:
        """Joins two blocks' faces, each given by block and side."""
        await self.use(
            "Joins two faces",
            {
                "connector begins": first[0],
                "face of block_a": self.face(*first),
                "where it ends": second[0],
                "face of block_b": self.face(*second),
                "Name of the connector": connector,
            },
        )

    async def turn_until(self, block: str, says: str, text: str) -> str:
        """Turns a block by quarters until the answer says something."""
        for _ in range(3):
            if says in text:
                break
            text = await self.use("Turns one block", {"Id of the block": block, "Degrees": 90})
        assert says in text, text
        return text

    def _tool(self, says: str) -> Any:
        (found,) = [tool for tool in self._tools.values() if says in tool.description]
        return found

    def _argument(self, tool: Any, says: str) -> str:
        properties = tool.input_schema["properties"]
        found = [name for name, one in properties.items() if says in one["description"]]
        assert len(found) == 1, (tool.name, says, found)
        return str(found[0])

    def _read_faces(self, text: str) -> None:
        """Notes which face of which block looks where, from every line that tells it."""
        block = None
        for line in text.splitlines():
            begins = re.match(r"(?:(?:Started|Attached|Moved)\. )?([A-Z]*_?\d+) [A-Z]", line)
            block = begins[1] if begins else block
            listed = re.search(r"(?:[Ff]aces: |free faces )(.*)", line)
            if block is not None and listed:
                faces = {side: label for label, side in _FACE.findall(listed[1])}
                self._faces[self.machine, block] = faces


def _id(text: str) -> str:
    (block,) = _BLOCK.findall(text)
    return block
