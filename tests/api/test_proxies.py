"""Whose X-Forwarded-For counts: asked of real API processes, where rate limits go by address."""

import os
import subprocess
import sys

import httpx
import pytest
from support.servers.stacks import wait_until

from buildarena_cli.local import free_port


@pytest.mark.ci
@pytest.mark.parametrize(("trusted", "counted"), [("", "together"), ("127.0.0.0/8", "apart")])
def test_forwarded_addresses_count_from_trusted_proxies_only(
    context, settings, trusted, counted
) -> None:
    port = free_port()
    environment = {
        **os.environ,
        # What the server itself reads, and trusts by default, must not matter.
        "FORWARDED_ALLOW_IPS": "*",
        "BUILDARENA_DATABASE_URL": settings.database_url or "",
        "BUILDARENA_BROKER_URL": settings.broker_url or "",
        "BUILDARENA_DATA": str(settings.data),
        "BUILDARENA_PORT": str(port),
        "BUILDARENA_RATE_LIMIT": "2/hour",
        "BUILDARENA_TRUSTED_PROXIES": trusted,
    }
    words = [sys.executable, "-m", "buildarena_api"]
    with (
        subprocess.Popen(words, env=environment, stderr=subprocess.DEVNULL) as process,
        httpx.Client(base_url=f"http://127.0.0.1:{port}") as client,
    ):
        try:
            wait_until(lambda: answers(client), 60, "the API answers")
            found = [
                client.get("/v1/models", headers={"X-Forwarded-For": f"10.0.0.{n}"}).status_code
                for n in range(4)
            ]
        finally:
            process.terminate()
    assert found == ([200] * 2 + [429] * 2 if counted == "together" else [200] * 4)
    del context


def answers(client: httpx.Client) -> bool:
    try:
        return client.get("/v1/health").is_success
    except httpx.TransportError:
        return False
