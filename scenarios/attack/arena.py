"""Where attacks take place: a whole service with keys, two tenants, and a hostile provider."""

from __future__ import annotations

import statistics
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import httpx
import psutil
import yaml
from support.clients.tenants import WITH_KEYS, Tenant, new_tenant, operator
from support.providers.stand_in import ProviderStandIn
from support.servers.stacks import running_stack

from buildarena_backend.database.database import Database
from buildarena_benchmark.environment.trials.processes import memory_bytes
from buildarena_cli.local.stack import Stack

HOSTILE = "hostile/model"
MEBI = 1 << 20
ASK_EVERY_S = 0.02


@dataclass
class Arena:
    """What scenarios work on."""

    stack: Stack
    database: Database
    operator: Tenant
    attacker: Tenant
    innocent: Tenant
    provider: ProviderStandIn
    sizes: Mapping[str, float]
    folder: Path
    victim: VictimClient = field(init=False)

    def process(self, name: str) -> psutil.Process:
        """A managed process by its name."""
        (managed,) = [m for m in self.stack.supervisor.managed if m.name == name]
        assert managed.process is not None
        return psutil.Process(managed.process.pid)

    def memory(self) -> dict[str, float]:
        """MiB of each process, the largest of those that fork."""
        found = {}
        for managed in self.stack.supervisor.managed:
            with suppress(psutil.Error, AttributeError):
                process = psutil.Process(managed.process.pid)  # type: ignore[union-attr]
                family = [process, *process.children(recursive=True)]
                found[managed.name] = max(map(memory_bytes, family)) / MEBI
        return found


@dataclass
class Tried:
    """What came of a scenario."""

    tried: str
    refused: str = ""
    wrong: list[str] = field(default_factory=list)

    def require(self, condition: object, what: str) -> None:
        """Notes something that is wrong."""
        if not condition:
            self.wrong.append(what)


class VictimClient(threading.Thread):
    """An innocent caller: lists jobs all the time, and notes how long it took."""

    def __init__(self, tenant: Tenant) -> None:
        super().__init__(name="victim")
        self._tenant, self._stopped, self._lock = tenant, threading.Event(), threading.Lock()
        self._times: list[float] = []
        self._failed = 0
        self._asked = threading.Event()

    def run(self) -> None:
        while not self._stopped.wait(ASK_EVERY_S):
            started = time.monotonic()
            try:
                good = self._tenant.ask("GET", "/v1/jobs?limit=20").status_code == 200
            except httpx.TransportError:
                good = False
            with self._lock:
                self._times.append(time.monotonic() - started)
                self._failed += not good
                self._asked.set()

    def take(self) -> tuple[float, int, int]:
        """99th percentile in seconds, requests, and failures since it was last asked."""
        with self._lock:
            times, failed = self._times, self._failed
            self._times, self._failed = [], 0
            self._asked.clear()
        high = statistics.quantiles(times, n=100)[98] if len(times) > 1 else 0.0
        return high, len(times), failed

    def wait_for_an_answer(self, seconds: float) -> None:
        """Returns once it has asked since it was last taken, or when that takes too long."""
        self._asked.wait(seconds)

    def stop(self) -> None:
        self._stopped.set()
        self.join()


@contextmanager
def arena(folder: Path, sizes: Mapping[str, float], **settings: Any) -> Iterator[Arena]:
    """A running service with all of it."""
    with ExitStack() as running:
        provider = running.enter_context(ProviderStandIn())
        models = folder / "models.yaml"
        entry = {"name": HOSTILE, "provider": "hostile", "model": "m"}
        wire = {"wire": "openai", "base_url": f"{provider.url}/v1"}
        models.write_text(yaml.safe_dump({"models": [entry], "providers": {"hostile": wire}}))
        stack = running.enter_context(
            running_stack(
                folder,
                **WITH_KEYS,
                models_file=models,
                sessions_per_worker=40,
                **settings,
            )
        )

        def client() -> httpx.Client:
            return running.enter_context(httpx.Client(base_url=stack.url, timeout=60))

        database = Database(stack.environment["BUILDARENA_DATABASE_URL"])
        running.callback(database.close)
        found = Arena(
            stack=stack,
            database=database,
            operator=operator(client()),
            attacker=new_tenant(client(), "attacker"),
            innocent=new_tenant(client(), "innocent"),
            provider=provider,
            sizes=sizes,
            folder=folder,
        )
        found.victim = VictimClient(replace(found.innocent, client=client()))
        found.victim.start()
        running.callback(found.victim.stop)
        yield found
