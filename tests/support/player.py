"""Sessions without database or simulator."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from buildarena_benchmark import Task, builtin_tasks
from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.catalog.prompt_packs import PromptPack, PromptPacks
from buildarena_pipeline.catalog.specs import Decoding
from buildarena_pipeline.submission.submission import model_config
from buildarena_store import JournalEntry, RolloutRecord
from buildarena_worker.providers import ModelClients
from buildarena_worker.session.host import ModelClient, SessionIO, SuspendedError
from buildarena_worker.session.session import Session
from buildarena_worker.workflow import Workflows
from buildarena_worker.workflow.rounds import Loop, run_session


@dataclass
class Played:
    """A session that was played up to its first simulation or its failure."""

    session: Session
    entries: list[JournalEntry]
    suspended: SuspendedError | None = None
    failure: Exception | None = None
    end: Any = None


@dataclass
class Player:
    """Plays sessions without database or simulator."""

    registry: Any = field(default_factory=load_registry)

    def __call__(
        self,
        model: str = "builtin/expert",
        *,
        task: str | Task = "support-1",
        seed: int = 0,
        workflow: str = "five-role",
        client: ModelClient | None = None,
        entries: Sequence[JournalEntry] = (),
        rollouts: Sequence[RolloutRecord] = (),
        limits: dict[str, Any] | None = None,
        append: Callable[[JournalEntry], None] | None = None,
        still_held: Callable[[], bool] = lambda: True,
        offline: bool = False,
        loop: Loop = Loop(),  # noqa: B008 - frozen
        pack: PromptPack | None = None,
        workflows: dict[str, str] = MappingProxyType({}),  # type: ignore[assignment]
        trajectories: dict[str, Any] = MappingProxyType({}),  # type: ignore[assignment]
    ) -> Played:
        config = model_config(self.registry, model, Decoding())
        if client is None and not offline:
            client = ModelClients(self.registry).for_config(config)
        written = list(entries)
        io = SessionIO(
            client=client,
            entries=list(entries),
            rollouts=rollouts,
            append=append or written.append,
            still_held=still_held,
            limits=limits or {},
            load_trajectory=trajectories.__getitem__,
        )
        session = Session(
            task=builtin_tasks()[task] if isinstance(task, str) else task,
            seed=seed,
            model_config=config,
            pack=pack or PromptPacks().load("default"),
            io=io,
        )
        played = Played(session=session, entries=written)
        try:
            played.end = run_session(session, Workflows(workflows).find(workflow), loop)
        except SuspendedError as suspended:
            played.suspended = suspended
        except Exception as failure:  # noqa: BLE001 - tests look at it
            played.failure = failure
        return played
