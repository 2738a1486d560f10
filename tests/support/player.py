"""Sessions without database or simulator."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from types import MappingProxyType, SimpleNamespace
from typing import Any

from buildarena_backend.catalog.models import load_registry
from buildarena_backend.catalog.prompt_packs import PromptPack, PromptPacks
from buildarena_backend.catalog.specs import Decoding
from buildarena_backend.journal.journal import JournalEntry
from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_backend.process.active_lease import ActiveLease
from buildarena_backend.submission.submission import model_config
from buildarena_benchmark import Task, builtin_tasks
from buildarena_benchmark.environment.briefing import describe_worlds
from buildarena_worker.providers.provider import ModelClients
from buildarena_worker.session.concurrency_gate import ConcurrencyGate
from buildarena_worker.session.host import JournalHost
from buildarena_worker.session.messages import ModelClient
from buildarena_worker.session.requester import Requester
from buildarena_worker.session.results import Finished, SessionResult, Suspended
from buildarena_worker.session.session import Session
from buildarena_worker.workflow import Workflows
from buildarena_worker.workflow.rounds import run_session


@dataclass
class Played:
    """A session that was played up to its first simulation or its failure."""

    session: Session
    entries: list[JournalEntry]
    result: SessionResult | Exception

    @property
    def suspended(self) -> Suspended | None:
        """The result, if the session waits for a simulation."""
        return self.result if isinstance(self.result, Suspended) else None

    @property
    def end(self) -> Finished | None:
        """The result, if the session came to its end."""
        return self.result if isinstance(self.result, Finished) else None

    @property
    def failure(self) -> SessionResult | Exception | None:
        """The result, if it is neither."""
        return None if self.suspended or self.end else self.result


class StoredInMemory:
    """A journal in memory."""

    def __init__(self, entries: list[JournalEntry], append: Any) -> None:
        self._append = append or entries.append

    def append(self, lease: Any, entry: JournalEntry) -> None:
        del lease
        self._append(entry)


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
        lost: bool = False,
        budgets: Any = None,
        offline: bool = False,
        loop: dict[str, Any] = MappingProxyType({}),  # type: ignore[assignment]
        pack: PromptPack | None = None,
        workflows: dict[str, str] = MappingProxyType({}),  # type: ignore[assignment]
        trajectories: dict[str, Any] = MappingProxyType({}),  # type: ignore[assignment]
        data_sheets: bool = True,
        worlds: int = 0,
        test_trials: bool = True,
    ) -> Played:
        config = model_config(self.registry, model, Decoding())
        if client is None and not offline:
            client = ModelClients(self.registry).for_config(config)
        written = list(entries)
        gate, requester = ConcurrencyGate(), None
        if client is not None:
            lease: Any = SimpleNamespace(job=SimpleNamespace(id="job"), token=1)
            active = ActiveLease(lease=lease, budgeted=False, lost=lost)
            requester = Requester(
                client=client,
                journal=StoredInMemory(written, append),  # type: ignore[arg-type]
                active=active,
                budgets=budgets,
                price=lambda *_: Decimal(),
                gate=gate,
            )
        given = {"limits": limits or {}, "load_trajectory": trajectories.__getitem__}
        host = JournalHost(entries=list(entries), rollouts=rollouts, requester=requester, **given)
        chosen = (builtin_tasks()[task] if isinstance(task, str) else task).with_seed(seed)
        if chosen.hidden_parameters is None and (loop.get("rounds", 1) > 1 or not test_trials):
            chosen = replace(chosen, test_trials=0)
        told = [describe_worlds(worlds)] if worlds else []
        pack = pack or PromptPacks().load("default")
        given = {"data_sheets": data_sheets, "additions": told, "model_config": config}
        session = Session(task=chosen, seed=seed, pack=pack, host=host, **given)
        try:
            with gate.acquired():
                result: Any = run_session(session, Workflows(workflows).find(workflow), **loop)
        except Exception as failure:  # noqa: BLE001 - tests look at it
            result = failure
        return Played(session=session, entries=written, result=result)
