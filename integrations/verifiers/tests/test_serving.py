"""The environment behind verifiers' own server, as trainers use it."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import signal

import psutil
import pytest
import verifiers.v1 as vf
from conftest import SUBMIT
from stand_in import serving
from verifiers.v1.serve import EnvClient, env_config_data, serve_env

from buildarena_verifiers import load_environment


@pytest.mark.parametrize("workers", [2])
def test_a_served_environment_plays_rows_that_it_is_sent(workers, scripts) -> None:
    environment = load_environment("lift-1", rewards={"indicator": 1.0}, processes=1)
    (task,) = environment.taskset
    processes = multiprocessing.get_context("spawn")
    addresses = processes.Queue()
    server = processes.Process(
        target=serve_env,
        kwargs={
            "config_data": env_config_data(environment.config),
            "max_workers": workers,
            "address": "tcp://127.0.0.1:0",
            "address_queue": addresses,
        },
    )
    server.start()
    try:
        address = addresses.get(timeout=60)

        async def play(url: str):
            client = EnvClient(address)
            try:
                return await asyncio.gather(
                    *(
                        client.run(
                            vf.EvalClientConfig(base_url=url),
                            "stand-in",
                            vf.SamplingConfig(),
                            task.data.model_dump(mode="json"),
                        )
                        for _ in range(2)
                    )
                )
            finally:
                await client.close()

        with serving({"lift-1": [[scripts["lift-1"], SUBMIT]]}) as stand_in:
            episodes = asyncio.run(play(stand_in.url))
        for episode in episodes:
            (trace,) = episode.traces
            assert trace.reward == pytest.approx(1.0, rel=0.02)
        children = psutil.Process(server.pid).children(recursive=True)
        assert children
    finally:
        os.kill(server.pid, signal.SIGTERM)
        server.join(30)
    assert server.exitcode is not None
    _, alive = psutil.wait_procs(children, timeout=20)
    assert not alive
