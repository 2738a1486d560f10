"""A pooler that hands out servers by the transaction stands between processes and Postgres."""

import threading

import httpx
import psycopg
import pytest
from sqlalchemy import text
from support.jobs import finish
from support.servers.live_api import changed, live_api
from support.servers.pgbouncer import needs_pgbouncer, pgbouncer

from buildarena_pipeline.runtime.context import open_context
from buildarena_pipeline.runtime.settings import Settings
from buildarena_store import Database

pytestmark = pytest.mark.ci

JOBS = 60
WORKERS = 8


@pytest.fixture
def pooled(context, tmp_path):
    with pgbouncer(context.settings.required_database_url(), tmp_path) as url:
        yield url


@needs_pgbouncer
def test_workers_share_few_servers_and_every_job_is_done_once(context, pooled, add) -> None:
    add(*range(JOBS))
    errors: list[BaseException] = []

    def work(number: int) -> None:
        try:
            with changed(context, database_url=pooled) as own:
                while lease := own.store.leases.claim("construct", owner=f"w{number}"):
                    # Often enough for the driver to prepare statements, if it were let.
                    for _ in range(8):
                        assert own.store.leases.heartbeat([lease]) == {lease.job.id: False}
                    finish(own, lease, "success", 1.0)
        except BaseException as error:
            errors.append(error)
            raise

    threads = [threading.Thread(target=work, args=(number,)) for number in range(WORKERS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not errors
    with context.store.database.transaction() as connection:
        query = text("SELECT count(*), sum(lease_token) FROM jobs WHERE state = 'done'")
        assert connection.execute(query).one() == (JOBS, JOBS)


@needs_pgbouncer
def test_the_api_answers_by_way_of_it(context, pooled) -> None:
    sweep = {"tasks": ["support-1"], "models": ["builtin/idle"], "seeds": [0, 1]}
    with changed(context, database_url=pooled) as own, live_api(own) as url:
        made = httpx.post(f"{url}/v1/sweeps", json=sweep)
        assert made.status_code == 202, made.text
        for _ in range(12):
            for path in ("jobs", "sweeps", "leaderboard", "health", "metrics", "workers"):
                answer = httpx.get(f"{url}/v1/{path}")
                assert answer.status_code == 200, answer.text


@needs_pgbouncer
def test_statements_are_prepared_without_a_pooler_only(context, pooled) -> None:
    def threshold(url: str) -> int | None:
        database = Database(url)
        with database.engine.connect() as connection:
            driver = connection.connection.driver_connection
            assert isinstance(driver, psycopg.Connection)
            found = driver.prepare_threshold
        database.close()
        return found

    assert threshold(pooled) is None
    assert threshold(context.settings.required_database_url()) is not None


def test_each_kind_of_process_is_told_apart_in_postgres(context) -> None:
    own = open_context(context.settings, name="buildarena-construct")
    with own.store.database.transaction() as connection:
        query = text("SELECT application_name FROM pg_stat_activity WHERE pid = pg_backend_pid()")
        assert connection.execute(query).scalar_one() == "buildarena-construct"
    own.close()


def test_migrations_and_collections_go_past_a_pooler() -> None:
    pooled = Settings(
        database_url="postgresql://a@pooler:6432/b", database_direct_url="postgresql://a@pg:5432/b"
    )
    assert pooled.direct_database_url() == "postgresql://a@pg:5432/b"
    plain = Settings(database_url="postgresql://a@pg:5432/b")
    assert plain.direct_database_url() == "postgresql://a@pg:5432/b"


def test_a_process_keeps_as_many_connections_as_the_setting_says(context) -> None:
    with changed(context, database_connections=3) as own:
        assert own.store.database.engine.pool.size() == 3
