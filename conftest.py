"""What all tests share: marks, servers on first use, a database per test worker, memory."""

from __future__ import annotations

import ctypes
import functools
import gc
import os
import re
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import psutil
import pytest
from support import blas_kernels  # noqa: F401 - before numpy is imported
from support.marks import mark_variants
from support.servers.run_servers import TEMPLATE, RunServers, execute, server_urls

if TYPE_CHECKING:
    from support.player import Player

    from buildarena_backend.process.context import Context
    from buildarena_backend.settings import Settings
    from buildarena_backend.submission.submission import Submissions

SERVERS: Final = pytest.StashKey[RunServers]()
VALKEY_DATABASES: Final = 16
LONGEST: Final = ("tests/web/", "scenarios/chaos/", "tests/e2e/", "tests/cli/local/")
"""Tests of whole services; at the end of a run one of them would be waited for."""
collect_ignore = [] if find_spec("ribs") else ["scenarios/hunt/test_hunt.py"]
"""The hunt's library is installed by `make scenario NAME=hunt` and `make test-nightly`."""
LEFT_OUT: Final = ("install the Debian packages", "make web")
MAX_ID: Final = 60
"""Characters of a parameter that its test's name has."""
MAX_GROWTH: Final = 60 * 2**20
"""Bytes that a test worker may grow by before garbage is collected."""
MEMORY: Final = {"collected": 0}
"""Bytes of this test worker when garbage was last collected."""


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leaves out modules that are marked as a whole, with the libraries that only they import."""
    left_out = re.findall(r"not (\w+)", config.option.markexpr)
    if left_out and collection_path.suffix == ".py":
        mark = re.search(r"^pytestmark = .*", collection_path.read_text(), re.MULTILINE)
        if mark and any(f"pytest.mark.{name}" in mark[0] for name in left_out):
            return True
    return None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Marks variants, and begins with what takes longest."""
    mark_variants(items)
    items.sort(key=lambda item: not item.nodeid.startswith(LONGEST))


def pytest_collection_finish() -> None:
    """Two million objects of modules and tests live to the end: the collector need not see them."""
    gc.collect()
    gc.freeze()
    MEMORY["collected"] = psutil.Process().memory_info().rss


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """Shortens long texts: an id of megabytes is sent to and fro, and printed in failures."""
    if isinstance(val, str | bytes) and len(val) > MAX_ID:
        begins = val[:MAX_ID] if isinstance(val, str) else argname
        return f"{begins}... {len(val)}".encode("unicode_escape").decode("ascii")
    return None


def pytest_configure(config: pytest.Config) -> None:
    # What is no test of varied worlds has its machines tried once.
    os.environ.setdefault("BUILDARENA_WORLDS", "0")
    if not hasattr(config, "workerinput"):
        config.stash[SERVERS] = RunServers()


def pytest_unconfigure(config: pytest.Config) -> None:
    if SERVERS in config.stash:
        config.stash[SERVERS].close()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Any:
    """In CI, a test that was left out for want of a program has failed."""
    del item, call
    report = yield
    if (
        report.skipped
        and os.environ.get("CI")
        and any(words in str(report.longrepr) for words in LEFT_OUT)
    ):
        report.outcome = "failed"
    return report


@pytest.fixture(autouse=True, scope="module")
def collected_garbage() -> Iterator[None]:
    """Collects what tests leave where it has become much; an app refers to itself.

    The collector looks at all that tests have made since the run began, which takes half a second:
    after each of 400 modules, that was a fifth of the run.
    """
    yield
    if psutil.Process().memory_info().rss > MEMORY["collected"] + MAX_GROWTH:
        gc.collect()
        if sys.platform == "linux":
            ctypes.CDLL(None).malloc_trim(0)
        MEMORY["collected"] = psutil.Process().memory_info().rss


@pytest.fixture(autouse=True)
def forgotten_apps() -> Iterator[None]:
    """Clears what FastAPI remembers of a test's apps."""
    yield
    if live_api := sys.modules.get("support.servers.live_api"):
        live_api.forget_apps()


@pytest.fixture(autouse=True, scope="session")
def certificates() -> Iterator[None]:
    """Has httpx read the authorities' certificates once: for each client, they take 40 ms."""
    import httpx

    with pytest.MonkeyPatch.context() as patch:
        made = functools.cache(httpx.create_ssl_context)
        patch.setattr("httpx._transports.default.create_ssl_context", made)
        yield


@pytest.fixture(scope="session")
def postgres_url() -> str:
    """The run's Postgres server."""
    return server_urls()[0]


@pytest.fixture(scope="session")
def database_url(worker_id: str, postgres_url: str) -> Iterator[str]:
    """A migrated database of this test worker's own."""
    name = f"test_{worker_id}"
    execute(postgres_url, f"CREATE DATABASE {name} TEMPLATE {TEMPLATE}")
    yield postgres_url.replace("/postgres", f"/{name}")
    execute(postgres_url, f"DROP DATABASE {name} WITH (FORCE)")


@pytest.fixture(scope="session")
def broker_url(worker_id: str) -> str:
    """A Valkey database of this test worker's own."""
    number = 0 if worker_id == "master" else 1 + int(worker_id.removeprefix("gw"))
    assert number < VALKEY_DATABASES
    return server_urls()[1].removesuffix("/0") + f"/{number}"


@pytest.fixture
def settings(database_url: str, broker_url: str, tmp_path: Path) -> Settings:
    """Settings that name the test servers and a folder of this test's own."""
    from buildarena_backend.settings import Settings

    return Settings(
        database_url=database_url, broker_url=broker_url, data=tmp_path / "data", lease_s=2.0
    )


@pytest.fixture
def context(settings: Settings) -> Iterator[Context]:
    """Connections to an empty database and an empty broker."""
    from redis import Redis
    from support.servers.databases import empty

    from buildarena_backend.process.context import open_context

    context = open_context(settings)
    empty(context.store.database)
    with Redis.from_url(settings.required_broker_url()) as valkey:
        valkey.flushdb()
    yield context
    context.close()


@pytest.fixture(scope="session")
def play() -> Player:
    """Plays sessions up to their first simulation, without database or simulator."""
    from support.player import Player

    return Player()


@pytest.fixture
def submissions(context: Context) -> Submissions:
    """Submits with the built-in registry."""
    from support.paid_models import REGISTRY

    from buildarena_backend.submission.submission import Submissions

    return Submissions(context, REGISTRY)
