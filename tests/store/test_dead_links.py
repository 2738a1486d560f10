"""Connections to the database over links that die, and pools whose connections all hang."""

import socket

import pytest
from sqlalchemy import text
from sqlalchemy.exc import OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from buildarena_store import Database
from buildarena_store.database import GIVEN_UP, GIVEN_UP_THERE


def settings_there(database: Database, *names: str) -> dict[str, str]:
    with database.transaction() as connection:
        query = text("SELECT current_setting(:name)")
        return {name: connection.execute(query, {"name": name}).scalar_one() for name in names}


def own_socket(database: Database) -> socket.socket:
    """A further handle of a connection's socket."""
    with database.engine.connect() as connection:
        handle = connection.connection.driver_connection.fileno()
        return socket.socket(fileno=socket.dup(handle))


def tcp_option(sock: socket.socket, name: str) -> int:
    return sock.getsockopt(socket.IPPROTO_TCP, getattr(socket, name))


@pytest.fixture
def database(database_url: str):
    found = Database(database_url)
    yield found
    found.close()


def test_both_ends_give_up_dead_connections_within_seconds(database) -> None:
    with own_socket(database) as sock:
        assert sock.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1
        assert tcp_option(sock, "TCP_KEEPIDLE") == GIVEN_UP["keepalives_idle"]
        assert tcp_option(sock, "TCP_KEEPINTVL") == GIVEN_UP["keepalives_interval"]
        assert tcp_option(sock, "TCP_KEEPCNT") == GIVEN_UP["keepalives_count"]
        assert tcp_option(sock, "TCP_USER_TIMEOUT") == GIVEN_UP["tcp_user_timeout"]
    assert settings_there(database, *GIVEN_UP_THERE) == {
        "tcp_keepalives_idle": "10",
        "tcp_keepalives_interval": "5",
        "tcp_keepalives_count": "3",
        "tcp_user_timeout": "20000",
    }


def test_what_the_url_asks_for_goes_before(database_url) -> None:
    asked = "tcp_user_timeout=1234&options=-c%20work_mem%3D5MB"
    database = Database(f"{database_url}?{asked}")
    with own_socket(database) as sock:
        assert tcp_option(sock, "TCP_USER_TIMEOUT") == 1234
        assert tcp_option(sock, "TCP_KEEPIDLE") == GIVEN_UP["keepalives_idle"]
    assert settings_there(database, "work_mem") == {"work_mem": "5MB"}
    database.close()


@pytest.mark.parametrize("how", ["transaction", "statement"])
def test_no_connection_in_time_is_an_outage_to_workers_and_known_to_the_api(
    database_url, how
) -> None:
    database = Database(database_url, pool_size=1, pool_timeout_s=0.1)
    with database.transaction(), database.transaction():
        with (
            pytest.raises(OperationalError, match="limit of size 1") as caught,
            getattr(database, how)(),
        ):
            pytest.fail("there is no third connection")
        assert isinstance(caught.value, PoolTimeoutError)
    assert settings_there(database, "jit") == {"jit": "off"}
    database.close()
