"""What the service has: tasks, models, modules, workers."""

from __future__ import annotations

from collections.abc import AsyncGenerator
from pathlib import Path
from typing import TYPE_CHECKING, cast

from buildarena_client.endpoints.sending import Sender
from buildarena_client.paths import HEALTH, at

if TYPE_CHECKING:
    from buildarena_client.schemas import (
        Caller,
        Health,
        Model,
        Module,
        Scorer,
        Simulator,
        Task,
        TaskDetail,
        Versions,
        Worker,
    )


class Catalogue(Sender):
    """What the service has: tasks, models, modules, workers."""

    async def health(self) -> Health:
        """How the service's parts are."""
        return cast("Health", await self.get(HEALTH))

    async def caller(self) -> Caller:
        """Whose key this is, and what it may do."""
        return cast("Caller", await self.get("/v1/caller"))

    async def tasks(self) -> list[Task]:
        """The tasks in their newest versions, the built-in ones first."""
        return await self.every("/v1/tasks")

    async def task(self, name: str, *, version: str | None = None) -> TaskDetail:
        """A task with its whole document; the newest version by default."""
        return cast("TaskDetail", await self.get(at("tasks", name), version=version))

    async def add_task(self, source: Path | str) -> TaskDetail:
        """Uploads a task.

        Args:
            source: A YAML file, or the YAML itself as text.
        """
        content = bytes(source, "utf-8") if isinstance(source, str) else source
        return cast("TaskDetail", await self.upload("/v1/tasks", content, "application/yaml"))

    async def models(self) -> list[Model]:
        """The models that jobs can name."""
        return await self.every("/v1/models")

    async def modules(
        self, *, of_set: str | None = None, task: str | None = None, version: str | None = None
    ) -> list[Module]:
        """The kinds of parts that machines are made of: the basic ones by default.

        Args:
            of_set: Those of a set: "basic", "workshop" or "all".
            task: Those that builders of a task may use.
            version: The task's; the newest by default.
        """
        return await self.every("/v1/modules", set=of_set, task=task, version=version)

    async def versions(self) -> Versions:
        """The versions that results depend on, and the constants of the boards' statistics."""
        return cast("Versions", await self.get("/v1/versions"))

    async def simulators(self) -> list[Simulator]:
        """What jobs can name as their simulator, and whether it is served at the moment."""
        return await self.every("/v1/simulators")

    async def scorers(self) -> list[Scorer]:
        """The scorers that task files can name, with their parameters and flags."""
        return await self.every("/v1/scorers")

    def workers(self, *, limit: int | None = None, page: int = 100) -> AsyncGenerator[Worker, None]:
        """The workers that were heard of lately, the last started first.

        Args:
            limit: How many at most; all by default.
            page: How many are asked for at once, 1 to 500.
        """
        return self._listed("/v1/workers", limit, page, {})
