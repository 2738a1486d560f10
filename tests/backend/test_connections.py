"""Connections to the database: links that die, pools that hang, and a pooler in between."""

import socket
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest
from sqlalchemy import text
from sqlalchemy.exc import OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError
from support.jobs import finish
from support.servers.live_api import changed, live_api
from support.servers.pgbouncer import needs_pgbouncer, pgbouncer

from buildarena_backend.database import database as database_module
from buildarena_backend.database.database import GIVEN_UP, GIVEN_UP_THERE, Database
from buildarena_backend.settings import Settings

JOBS, WORKERS = 40, 6


def settings_there(database: Database, *names: str) -> dict[str, str]:
    with database.transaction() as connection:
        query = text("SELECT current_setting(:name)")
        return {name: connection.execute(query, {"name": name}).scalar_one() for name in names}


def tcp_options(database: Database) -> dict[str, int]:
    names = ("TCP_KEEPIDLE", "TCP_KEEPINTVL", "TCP_KEEPCNT", "TCP_USER_TIMEOUT")
    with database.engine.connect() as connection:
        handle = connection.connection.driver_connection.fileno()
        with socket.socket(fileno=socket.dup(handle)) as sock:
            return {n: sock.getsockopt(socket.IPPROTO_TCP, getattr(socket, n)) for n in names}


def test_both_ends_give_up_dead_connections_within_seconds(database_url) -> None:
    database = Database(database_url)
    found = tcp_options(database)
    names = ("keepalives_idle", "keepalives_interval", "keepalives_count", "tcp_user_timeout")
    assert list(found.values()) == [GIVEN_UP[name] for name in names]
    alive = {"tcp_keepalives_idle": "10", "tcp_keepalives_interval": "5"}
    alive |= {"tcp_keepalives_count": "3", "tcp_user_timeout": "20000"}
    assert settings_there(database, *GIVEN_UP_THERE) == alive
    database.close()
    # What the URL asks for goes before.
    own = Database(f"{database_url}?tcp_user_timeout=1234&options=-c%20work_mem%3D5MB")
    assert tcp_options(own) == {**found, "TCP_USER_TIMEOUT": 1234}
    assert settings_there(own, "work_mem") == {"work_mem": "5MB"}
    own.close()


@pytest.mark.parametrize("how", ["transaction", "statement"])
def test_no_connection_in_time_is_an_outage_to_workers_and_the_api_knows(database_url, how) -> None:
    database = Database(database_url, pool_size=1, pool_timeout_s=0.1)
    with database.transaction(), database.transaction():
        refused = pytest.raises(OperationalError, match="limit of size 1")
        with refused as caught, getattr(database, how)():
            pytest.fail("there is no third connection")
        assert isinstance(caught.value, PoolTimeoutError)
    database.close()


@pytest.mark.parametrize("idle_s", [0.0, 1000.0])
def test_a_connection_that_the_server_dropped_is_noticed(context, monkeypatch, idle_s) -> None:
    monkeypatch.setattr(database_module, "IDLE_S", idle_s)
    other = Database(context.store.database.url)

    def backend() -> int:
        with context.store.database.statement() as connection:
            return int(connection.exec_driver_sql("SELECT pg_backend_pid()").scalar_one())

    before = backend()
    with other.transaction() as connection:
        connection.exec_driver_sql(f"SELECT pg_terminate_backend({before}, 5000)")
    other.close()
    if idle_s:
        # A busy connection's break reaches its user, once.
        with pytest.raises(OperationalError):
            backend()
    assert backend() != before


@pytest.mark.ci
@needs_pgbouncer
def test_workers_and_the_api_share_few_servers_of_a_pooler(context, add, tmp_path) -> None:
    def work(number: int) -> None:
        with changed(context, database_url=pooled) as own:
            while lease := own.store.leases.claim("construct", owner=f"w{number}"):
                # Often enough for the driver to prepare statements, if it were let.
                for _ in range(8):
                    assert own.store.leases.heartbeat([lease]) == {lease.job.id: False}
                finish(own, lease, "success", 1.0)

    with pgbouncer(context.settings.required_database_url(), tmp_path) as pooled:
        sweep = {"tasks": ["support-1"], "models": ["builtin/idle"], "seeds": [0]}
        with live_api(context, database_url=pooled) as url:
            made = httpx.post(f"{url}/v1/sweeps", json=sweep)
            assert made.status_code == 201, made.text
            for path in 8 * ("jobs", "sweeps", "leaderboard", "health", "metrics", "workers"):
                answer = httpx.get(f"{url}/v1/{path}")
                assert answer.status_code == 200, answer.text
        add(*range(JOBS - 1))
        with ThreadPoolExecutor(WORKERS) as threads:
            list(threads.map(work, range(WORKERS)))
        with context.store.database.transaction() as connection:
            query = text("SELECT count(*), sum(lease_token) FROM jobs WHERE state = 'done'")
            assert connection.execute(query).one() == (JOBS, JOBS)


def test_migrations_and_collections_go_past_a_pooler(context) -> None:
    pooled = Settings(
        database_url="postgresql://a@pooler:6432/b", database_direct_url="postgresql://a@pg:5432/b"
    )
    assert pooled.direct_database_url() == "postgresql://a@pg:5432/b"
    plain = Settings(database_url="postgresql://a@pg:5432/b")
    assert plain.direct_database_url() == "postgresql://a@pg:5432/b"
    with changed(context, database_connections=3) as own:
        assert own.store.database.engine.pool.size() == 3
