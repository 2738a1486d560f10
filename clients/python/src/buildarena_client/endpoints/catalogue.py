"""Contents of the service: tasks, models, modules, workers."""

from __future__ import annotations

from collections.abc import AsyncGenerator
from pathlib import Path
from typing import TYPE_CHECKING, cast

from buildarena_client.endpoints.base import Sender
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
    """Contents of the service: tasks, models, modules, workers."""

    async def health(self) -> Health:
        """Return the state of the service's parts."""
        return cast("Health", await self.get(HEALTH))

    async def caller(self) -> Caller:
        """Return the owner of this key, and its permissions."""
        return cast("Caller", await self.get("/v1/caller"))

    async def tasks(self) -> list[Task]:
        """Return the newest versions of the tasks, the built-in ones first."""
        return await self.every("/v1/tasks")

    async def task(self, name: str, *, version: str | None = None) -> TaskDetail:
        """Return a task with its whole document; the newest version by default."""
        return cast("TaskDetail", await self.get(at("tasks", name), version=version))

    async def add_task(self, source: Path | str) -> TaskDetail:
        """Upload a task.

        Args:
            source: YAML file, or YAML text.
        """
        content = bytes(source, "utf-8") if isinstance(source, str) else source
        return cast("TaskDetail", await self.upload("/v1/tasks", content, "application/yaml"))

    async def models(self) -> list[Model]:
        """Return the models that jobs can name."""
        return await self.every("/v1/models")

    async def modules(
        self, *, of_set: str | None = None, task: str | None = None, version: str | None = None
    ) -> list[Module]:
        """Return the modules that machines are made of: the basic ones by default.

        Args:
            of_set: Set of modules: "basic", "workshop" or "all".
            task: Task whose modules are returned.
            version: Version of the task. Defaults to the newest.
        """
        return await self.every("/v1/modules", set=of_set, task=task, version=version)

    async def versions(self) -> Versions:
        """Return the versions that results depend on, and the constants of boards' statistics."""
        return cast("Versions", await self.get("/v1/versions"))

    async def simulators(self) -> list[Simulator]:
        """Return the simulators that jobs can name, and whether each is running at the moment."""
        return await self.every("/v1/simulators")

    async def scorers(self) -> list[Scorer]:
        """Return the scorers that task files can name, with their parameters and flags."""
        return await self.every("/v1/scorers")

    def workers(self, *, limit: int | None = None, page: int = 100) -> AsyncGenerator[Worker, None]:
        """Yield the recently active workers, the last started first.

        Args:
            limit: Maximum number of rows. Defaults to all.
            page: Rows per request, 1 to 500.
        """
        return self._listed("/v1/workers", limit, page, {})
