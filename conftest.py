"""One Postgres and one Valkey a run, one database per test worker, empty for each test."""

from __future__ import annotations

import gc
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from fastapi.dependencies import models as dependencies
from redis import Redis
from sqlalchemy import create_engine, text
from support import blas_kernels  # noqa: F401 - before numpy is imported
from support.clients import one_trust  # noqa: F401 - before clients are made
from support.long_tests import LONG
from support.player import Player
from support.servers.databases import empty

from buildarena_cli.local import EmbeddedPostgres, EmbeddedValkey
from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.runtime.context import Context, open_context
from buildarena_pipeline.runtime.settings import Settings
from buildarena_pipeline.submission.submission import Submissions
from buildarena_store import Database

TEMPLATE = "buildarena_template"
SERVERS = pytest.StashKey[ExitStack]()
VALKEY_DATABASES = 16
LONGEST = ("tests/web/", "scenarios/chaos/", "tests/e2e/", "tests/cli/local/")
"""Tests of whole services; at the end of a run one of them would be waited for."""
REMEMBERED = [known for known in vars(dependencies).values() if hasattr(known, "cache_clear")]
LEFT_OUT = ("install the Debian packages", "make web")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leaves long variants to `make test-long`, and begins with what takes longest."""
    _leave_all_but_samples_to_slow(items)
    if not LONG:
        left = [item for item in items if item.get_closest_marker("long")]
        config.hook.pytest_deselected(items=left)
        items[:] = [item for item in items if not item.get_closest_marker("long")]
    items.sort(key=lambda item: not item.nodeid.startswith(LONGEST))


def _leave_all_but_samples_to_slow(items: list[pytest.Item]) -> None:
    """Marks as slow what a test of samples has beyond them; they are spread over its variants."""
    variants: dict[str, list[pytest.Item]] = {}
    for item in items:
        if item.get_closest_marker("samples") and not item.get_closest_marker("slow"):
            variants.setdefault(item.nodeid.partition("[")[0], []).append(item)
    for group in variants.values():
        marker = group[0].get_closest_marker("samples")
        assert marker is not None
        most = marker.args[0]
        chosen = {round(number * len(group) / most) for number in range(most)}
        for number, item in enumerate(group):
            if number not in chosen:
                item.add_marker("slow")


def pytest_collection_finish() -> None:
    """Two million objects of modules and tests live to the end: the collector need not see them."""
    gc.collect()
    gc.freeze()


def pytest_configure(config: pytest.Config) -> None:
    # What is no test of varied worlds has its machines tried once.
    os.environ.setdefault("BUILDARENA_WORLDS", "0")
    if hasattr(config, "workerinput") or config.option.collectonly:
        return
    with ExitStack() as stack:
        folder = Path(tempfile.mkdtemp(prefix="buildarena-tests-"))
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        postgres = EmbeddedPostgres(folder / "pg", folder / "pg.log", durable=False)
        stack.callback(postgres.stop, postgres.start())
        valkey = EmbeddedValkey(folder / "valkey", folder / "valkey.log")
        stack.callback(valkey.stop, valkey.start())
        template = Database(postgres.url.replace("/postgres", f"/{TEMPLATE}"))
        _execute(postgres.url, f"CREATE DATABASE {TEMPLATE}")
        template.migrate()
        template.close()
        os.environ["TEST_POSTGRES_URL"] = postgres.url
        os.environ["TEST_VALKEY_URL"] = valkey.url
        config.stash[SERVERS] = stack.pop_all()


def pytest_unconfigure(config: pytest.Config) -> None:
    stack = config.stash.get(SERVERS, None)
    if stack is not None:
        stack.close()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Any:
    """Where everything must run, a test that was left out for want of a program has failed."""
    del item, call
    report = yield
    if (
        report.skipped
        and os.environ.get("BUILDARENA_TEST_ALL")
        and any(words in str(report.longrepr) for words in LEFT_OUT)
    ):
        report.outcome = "failed"
    return report


def _execute(url: str, statement: str) -> None:
    engine = create_engine(
        url.replace("postgresql://", "postgresql+psycopg://"), isolation_level="AUTOCOMMIT"
    )
    with engine.connect() as connection:
        connection.execute(text(statement))
    engine.dispose()


@pytest.fixture(autouse=True)
def forgotten_apps() -> Iterator[None]:
    """FastAPI remembers functions of the last thousand apps, and these their apps: gigabytes."""
    yield
    for cache in REMEMBERED:
        cache.cache_clear()


@pytest.fixture(autouse=True, scope="module")
def collected_apps() -> Iterator[None]:
    """An app refers to itself, so that only the collector ends it."""
    yield
    gc.collect()


@pytest.fixture(scope="session")
def database_url(worker_id: str) -> Iterator[str]:
    """A migrated database of this test worker's own."""
    server, name = os.environ["TEST_POSTGRES_URL"], f"test_{worker_id}"
    _execute(server, f"CREATE DATABASE {name} TEMPLATE {TEMPLATE}")
    yield server.replace("/postgres", f"/{name}")
    _execute(server, f"DROP DATABASE {name} WITH (FORCE)")


@pytest.fixture(scope="session")
def broker_url(worker_id: str) -> str:
    """A Valkey database of this test worker's own."""
    number = 0 if worker_id == "master" else 1 + int(worker_id.removeprefix("gw"))
    assert number < VALKEY_DATABASES
    return os.environ["TEST_VALKEY_URL"].removesuffix("/0") + f"/{number}"


@pytest.fixture
def settings(database_url: str, broker_url: str, tmp_path: Path) -> Settings:
    """Settings that name the test servers and a folder of this test's own."""
    return Settings(
        database_url=database_url, broker_url=broker_url, data=tmp_path / "data", lease_s=2.0
    )


@pytest.fixture
def context(settings: Settings) -> Iterator[Context]:
    """Connections to an empty database and an empty broker."""
    context = open_context(settings)
    empty(context.store.database)
    with Redis.from_url(settings.required_broker_url()) as valkey:
        valkey.flushdb()
    yield context
    context.close()


@pytest.fixture(scope="session")
def play() -> Player:
    """Plays sessions up to their first simulation, without database or simulator."""
    return Player()


@pytest.fixture
def submissions(context: Context) -> Submissions:
    """Submits with the built-in registry."""
    return Submissions(context, load_registry())
