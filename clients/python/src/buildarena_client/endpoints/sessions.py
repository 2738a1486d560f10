"""Sessions of external agents, and machines from files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

from buildarena_client.endpoints.base import Sender
from buildarena_client.paths import at

if TYPE_CHECKING:
    from buildarena_client.schemas import Job, MachineCheck, Session, ToolOutcome

MACHINE_FILE: Final = "application/octet-stream"


class Sessions(Sender):
    """Sessions of external agents, and machines from files."""

    async def open_session(
        self, /, task: str, agent: str, *, seed: int = 0, **more: Any
    ) -> Session:
        """Open a session in which your agent builds for one task.

        The same arguments return the same session while it is open.

        Args:
            task: Task to build for.
            agent: Name of the agent on the leaderboard.
            seed: Number of the try.
            more: ``simulator``, and ``kind`` for a person.
        """
        body = {"task": task, "agent": agent, "seed": seed, **more}
        return cast("Session", await self.post("/v1/sessions", body, repeatable=True))

    async def session(self, session_id: str) -> Session:
        """Return a session: its machines, its tools, and the remaining limits."""
        return cast("Session", await self.get(at("sessions", session_id)))

    async def session_machine(self, session_id: str) -> Any:
        """Return the document of the machine that a submission would simulate now."""
        return await self.get(at("sessions", session_id, "machine"))

    async def call_tool(
        self,
        session_id: str,
        tool: str,
        arguments: Mapping[str, Any] | None = None,
        *,
        machine: str = "main",
    ) -> ToolOutcome:
        """Execute one action; a refused one changes nothing. Never sent twice.

        Args:
            arguments: Values of its parameters.
            machine: Sub-structure to act on.
        """
        body = {"tool": tool, "arguments": dict(arguments or {}), "machine": machine}
        return cast("ToolOutcome", await self.post(at("sessions", session_id, "calls"), body))

    async def test_session(self, session_id: str) -> Job:
        """Simulate the present machine, if the task has test trials. Never sent twice."""
        return cast("Job", await self.post(at("sessions", session_id, "tests")))

    async def submit_session(self, session_id: str) -> Job:
        """End a session; the machine is simulated and scored."""
        return cast("Job", await self.post(at("sessions", session_id, "submit")))

    async def check_machine(self, source: Path | bytes, *, task: str | None = None) -> MachineCheck:
        """Return the content of a machine's file and its faults.

        Args:
            source: Machine document or machine file of the game, or its bytes.
            task: Task whose rules it must keep, if any.
        """
        answer = await self.upload(
            "/v1/machines/check", source, MACHINE_FILE, repeatable=True, task=task
        )
        return cast("MachineCheck", answer)

    async def try_machine(
        self, source: Path | bytes, *, task: str, simulator: str | None = None, seed: int = 0
    ) -> Job:
        """Simulate a machine from a file in a task's trial, on no leaderboard.

        An equal earlier trial is returned instead.

        Args:
            source: Machine document or machine file of the game, or its bytes.
            task: Task with the trial.
            simulator: Simulator to use. Defaults to the service's.
            seed: Seed of the trial.
        """
        asked = {"task": task, "simulator": simulator, "seed": seed}
        answer = await self.upload(
            "/v1/machines/trials", source, MACHINE_FILE, repeatable=True, **asked
        )
        return cast("Job", answer)
