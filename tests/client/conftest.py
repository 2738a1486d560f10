"""One service for each module, both clients, and pauses that take no time."""

from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace

import pytest
from pydantic import SecretStr
from redis import Redis
from support.clients.either_client import EitherClient
from support.clients.tenants import ADMIN
from support.servers.databases import empty
from support.servers.live_api import live_api
from support.servers.stacks import meanwhile
from support.stages import work

from buildarena_backend.catalog.models import load_registry
from buildarena_backend.catalog.specs import SweepSpec
from buildarena_backend.process.context import Context, open_context
from buildarena_backend.settings import Settings
from buildarena_backend.submission.submission import Submissions
from buildarena_client.transport import Transport

KINDS = ("sync", "async")
SPEC = {"name": "first", "tasks": ["lift-1"], "seeds": [0, 1, 2], "simulator": "mujoco"}
SPEC["models"] = ["builtin/expert", "builtin/idle"]


@dataclass(frozen=True)
class Service:
    """A live service with a sweep that has ended.

    Attributes:
        url: Where it is, for whoever asks.
        locked: Where it asks for keys.
        context: What it stands on.
        sweep: The sweep's id.
        jobs: Its jobs' ids, the newest first.
        built: One of them that has a machine and a trial.
    """

    url: str
    locked: str
    context: Context
    sweep: str
    jobs: list[str]
    built: str

    def working(self) -> AbstractContextManager[None]:
        """Workers do what waits, beside the test."""
        return meanwhile(lambda: work(self.context), every_s=0.05)


@pytest.fixture
def pauses(monkeypatch) -> list[float]:
    """How long clients would have waited: they do not wait."""
    asked: list[float] = []

    async def pause(_transport, seconds: float) -> None:
        asked.append(seconds)

    monkeypatch.setattr(Transport, "pause", pause)
    return asked


@pytest.fixture(autouse=True)
def unset(monkeypatch) -> None:
    for name in ("BUILDARENA_URL", "BUILDARENA_KEY", "BUILDARENA_KEY_FILE"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(scope="module")
def service(database_url, broker_url, tmp_path_factory) -> Iterator[Service]:
    stores = {"database_url": database_url, "broker_url": broker_url}
    settings = Settings(**stores, data=tmp_path_factory.mktemp("data"), lease_s=2.0)
    context = open_context(settings)
    empty(context.store.database)
    with Redis.from_url(broker_url) as valkey:
        valkey.flushdb()
    spec = SweepSpec.model_validate(SPEC)
    sweep = Submissions(context, load_registry()).submit_sweep(spec).sweep.id
    work(context)
    keys = {"require_keys": True, "admin_key": SecretStr(ADMIN), "rate_limit": "1000000/minute"}
    locked = replace(context, settings=settings.model_copy(update=keys))
    jobs = context.store.jobs.page(limit=100)
    with live_api(context) as url, live_api(locked) as locked_url:
        built = next(job.id for job in jobs if job.model == "builtin/expert")
        made = {"context": context, "sweep": sweep, "jobs": [job.id for job in jobs]}
        yield Service(url=url, locked=locked_url, built=built, **made)
    context.close()


@pytest.fixture(params=KINDS)
def make(request) -> Iterator[type[EitherClient]]:
    """Makes clients of one kind."""
    made: list[EitherClient] = []

    def make_one(*given, **more) -> EitherClient:
        made.append(EitherClient(request.param, *given, **more))
        return made[-1]

    make_one.kind = request.param
    yield make_one
    for one in made:
        one.end()


@pytest.fixture
def client(make, service) -> EitherClient:
    return make(service.url)
