"""Plays a session against litellm's proxy, which is started from an environment of its own.

Run by ``make peer``; the proxy and all it needs are installed into .venv-peer.
"""

import os
import subprocess
import sys
import time
from pathlib import Path

import httpx
from support.player import Player

from buildarena_cli.local import free_port
from buildarena_pipeline.catalog.models import ModelEntry, ProviderEntry
from buildarena_worker.providers.provider import ProviderClient

HERE = Path(__file__).parent


def main() -> None:
    """Starts the proxy, plays a session, and compares what both sides counted."""
    port = free_port()
    url = f"http://127.0.0.1:{port}"
    command = [sys.argv[1], "--config", str(HERE / "litellm.yaml"), "--host", "127.0.0.1"]
    environment = {**os.environ, "LITELLM_LOCAL_MODEL_COST_MAP": "True", "NO_DOCS": "True"}
    proxy = subprocess.Popen(
        [*command, "--port", str(port), "--telemetry", "False"],
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        _wait(f"{url}/health/liveliness")
        client = ProviderClient(
            ModelEntry(name="peer/peer", provider="peer", model="peer"),
            ProviderEntry(protocol="openai", base_url=f"{url}/v1"),
        )
        played = Player()("builtin/idle", client=client)
        client.close()
    finally:
        proxy.terminate()
        proxy.wait()
    replies = [turn.text for turn in played.session.transcript.turns]
    tokens = [entry.usage.input_tokens for entry in played.entries]
    assert replies == ["TERMINATE", "TERMINATE"], replies
    assert all(count > 0 for count in tokens), tokens
    sys.stdout.write(f"litellm's proxy answered {len(replies)} requests; tokens in: {tokens}\n")


def _wait(url: str) -> None:
    for _ in range(120):
        try:
            httpx.get(url, timeout=2).raise_for_status()
        except httpx.HTTPError:
            time.sleep(0.5)
        else:
            return
    raise SystemExit("litellm's proxy did not start")


if __name__ == "__main__":
    main()
