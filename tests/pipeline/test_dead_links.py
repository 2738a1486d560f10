"""Links to the broker that die, and threads that must outlive what nobody foresaw."""

from __future__ import annotations

import os
import socket
import threading

import psutil
import pytest
import uvicorn
import uvloop
from fastapi import FastAPI
from kombu.exceptions import OperationalError
from support.servers.stacks import wait_until

from buildarena_api.http.rate_limits import RateLimits
from buildarena_api.http.serving import UNANSWERED_S, Server
from buildarena_cli.local import free_port
from buildarena_pipeline.broker.app import LONGEST_PAUSE_S, celery_app
from buildarena_pipeline.keepalive import socket_options, tcp_options
from buildarena_pipeline.runtime.active_lease import LeaseKeeper


def test_options_are_those_that_the_system_has() -> None:
    assert tcp_options()[socket.TCP_KEEPIDLE] == 5
    assert tcp_options()[socket.TCP_USER_TIMEOUT] == 10_000
    with socket.socket() as sock:
        for level, name, value in socket_options():
            sock.setsockopt(level, name, value)
            assert sock.getsockopt(level, name) == value


def test_consumers_try_a_broker_that_is_away_every_few_seconds(monkeypatch) -> None:
    app = celery_app(f"redis://127.0.0.1:{free_port()}/0")
    pauses = []
    monkeypatch.setattr("kombu.utils.functional.sleep", lambda _: None)
    with app.connection_for_read() as connection, pytest.raises(OperationalError):
        connection.ensure_connection(lambda _, pause: pauses.append(pause), 9)
    assert pauses == [1, 2, 3, 4, *[LONGEST_PAUSE_S] * 5]
    app.close()


def test_consumers_give_up_dead_links_to_the_broker(broker_url) -> None:
    app = celery_app(broker_url)
    with app.connection_for_read() as connection, connection.channel() as channel:
        pool = channel.pool
        one = pool.get_connection()
        for level, name, value in socket_options():
            assert one._sock.getsockopt(level, name) == value
        pool.release(one)
    app.close()


def test_the_api_gives_up_clients_that_are_gone() -> None:
    port = free_port()
    server = Server(uvicorn.Config(FastAPI(), port=port, log_config=None, loop="uvloop"))
    thread = threading.Thread(target=server.run)
    thread.start()
    wait_until(lambda: server.started, 10, "it listens")
    with socket.create_connection(("127.0.0.1", port)) as client:
        inner = wait_until(lambda: accepted(client.getsockname()[1]), 5, "it is accepted")
        for level, name, value in socket_options(unanswered_s=UNANSWERED_S):
            assert inner.getsockopt(level, name) == value
        inner.close()
    server.should_exit = True
    thread.join()


def accepted(client_port: int) -> socket.socket | None:
    """A handle of this process' own end of a client's connection."""
    for one in psutil.Process().net_connections("tcp"):
        if one.raddr and one.raddr.port == client_port:
            return socket.socket(fileno=os.dup(one.fd))
    return None


def test_a_connection_that_ended_unseen_leaves_a_request_to_the_own_count(broker_url) -> None:
    async def asked() -> list[int | None]:
        limits = RateLimits(broker_url, "2/minute")
        found = [await limits.hit("dead-links")]
        for connection in limits._pool._available_connections:
            connection._writer.transport.abort()
        found += [await limits.hit("dead-links") for _ in range(3)]
        await limits.close()
        return found

    first, *others = uvloop.run(asked())
    assert first is None
    # The process' own count begins anew.
    assert others[:2] == [None, None]
    assert others[2] is not None


@pytest.mark.ci
def test_heartbeats_go_on_whatever_they_meet(context) -> None:
    beats = []

    def beat() -> None:
        beats.append(1)
        raise RuntimeError("nobody foresaw this")

    keeper = LeaseKeeper(context.store.leases, beat)
    keeper.start()
    wait_until(lambda: len(beats) >= 2, 5, "a second beat after the first failed")
    keeper.stop()
