"""Sessions of external agents, and machines from files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

from buildarena_client.endpoints.sending import Sender
from buildarena_client.paths import at

if TYPE_CHECKING:
    from buildarena_client.schemas import Job, MachineCheck, Session, ToolOutcome

MACHINE_FILE: Final = "application/octet-stream"


class Sessions(Sender):
    """Sessions of external agents, and machines from files."""

    async def open_session(
        self, /, task: str, agent: str, *, seed: int = 0, **more: Any
    ) -> Session:
        """Opens a session in which an agent of yours builds for one task.

        The same arguments give the same session for as long as it is open.

        Args:
            task: What is to be built.
            agent: Its name on the leaderboard.
            seed: Which try it is.
            more: ``simulator``, and ``kind`` for a person.
        """
        body = {"task": task, "agent": agent, "seed": seed, **more}
        return cast("Session", await self.post("/v1/sessions", body, repeatable=True))

    async def session(self, session_id: str) -> Session:
        """A session: its machines, its tools, and how much is left."""
        return cast("Session", await self.get(at("sessions", session_id)))

    async def session_machine(self, session_id: str) -> Any:
        """The document of the machine that a submission would try now."""
        return await self.get(at("sessions", session_id, "machine"))

    async def call_tool(
        self,
        session_id: str,
        tool: str,
        arguments: Mapping[str, Any] | None = None,
        *,
        machine: str = "main",
    ) -> ToolOutcome:
        """Carries out one action; a refused one changes nothing. Never sent twice.

        Args:
            session_id: The session.
            tool: Which tool.
            arguments: What its parameters ask for.
            machine: The sub-structure it is meant for.
        """
        body = {"tool": tool, "arguments": dict(arguments or {}), "machine": machine}
        return cast("ToolOutcome", await self.post(at("sessions", session_id, "calls"), body))

    async def test_session(self, session_id: str) -> Job:
        """Has the machine tried as it stands, where the task has test trials. Never sent twice."""
        return cast("Job", await self.post(at("sessions", session_id, "tests")))

    async def submit_session(self, session_id: str) -> Job:
        """Ends a session; the machine is simulated and scored."""
        return cast("Job", await self.post(at("sessions", session_id, "submit")))

    async def check_machine(self, source: Path | bytes, *, task: str | None = None) -> MachineCheck:
        """What a machine's file is and what is wrong with it.

        Args:
            source: A machine document or a machine file of the game, or its bytes.
            task: Whose rules it must keep, if any.
        """
        answer = await self.upload(
            "/v1/machines/check", source, MACHINE_FILE, repeatable=True, task=task
        )
        return cast("MachineCheck", answer)

    async def try_machine(
        self, source: Path | bytes, *, task: str, simulator: str | None = None, seed: int = 0
    ) -> Job:
        """Puts a machine from a file through a task's trial, on no leaderboard.

        An equal one that was tried is the answer.

        Args:
            source: A machine document or a machine file of the game, or its bytes.
            task: Whose trial.
            simulator: What simulates it; the service's default by default.
            seed: Of the trial.
        """
        asked = {"task": task, "simulator": simulator, "seed": seed}
        answer = await self.upload(
            "/v1/machines/trials", source, MACHINE_FILE, repeatable=True, **asked
        )
        return cast("Job", answer)
