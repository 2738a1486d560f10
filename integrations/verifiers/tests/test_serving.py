"""The environment behind verifiers' own server, as trainers use it, and prime-rl's form."""

import asyncio
import multiprocessing
import os
import signal
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest
import verifiers.v1 as vf
from conftest import SUBMIT
from stand_in import serving
from support.documents.code_blocks import shown_in
from verifiers.v1.serve import EnvClient, env_config_data, serve_env
from verifiers.v1.utils.loaders import resolve_env_config

from buildarena_verifiers import BuildEnv

pytestmark = pytest.mark.nightly

README = Path(__file__).parents[1] / "README.md"
SOURCE = {"name", "env", "serve", "sampling", "group_size", "ratio", "interval"}
"""What prime-rl reads of a source; all but `env` and `serve` is its own."""


def sources() -> Iterator[dict[str, Any]]:
    """The sources of the configurations for prime-rl that the README shows."""
    for shown in shown_in(README):
        if shown.language == "toml":
            sections = tomllib.loads(shown.code)
            groups = sections.get("orchestrator", {"eval": sections})
            for group in groups.values():
                yield from group["source"]


def test_prime_rls_sources_name_rows_of_ours() -> None:
    names = []
    for source in sources():
        assert source.keys() <= SOURCE
        config = resolve_env_config(source["env"])
        vf.ServeConfig.model_validate(source.get("serve", {}))
        environment = vf.load_environment(config)
        assert isinstance(environment, BuildEnv)
        assert config.agent_harnesses()["agent"].id == "buildarena_verifiers"
        assert config.agent.runtime.type == "subprocess"
        names.append([task.data.name for task in environment.taskset])
    bridges, training, held_out = names
    assert bridges == ["support-1"]
    assert len(training) == 16
    assert not set(training) & set(held_out)


def test_a_wrong_setting_of_a_source_is_refused() -> None:
    source = next(sources())
    source["env"]["taskset"]["task"] = {"trial_timout_s": 3}
    with pytest.raises(ValueError, match="trial_timout_s"):
        resolve_env_config(source["env"])


def test_a_served_environment_plays_rows_that_it_is_sent(scripts) -> None:
    environment = vf.load_environment(resolve_env_config(next(sources())["env"]))
    (task,) = environment.taskset
    processes = multiprocessing.get_context("spawn")
    addresses = processes.Queue()
    told = {"config_data": env_config_data(environment.config), "max_workers": 2}
    told |= {"address": "tcp://127.0.0.1:0", "address_queue": addresses}
    server = processes.Process(target=serve_env, kwargs=told)
    server.start()
    try:
        address = addresses.get(timeout=60)

        async def play(url: str):
            client = EnvClient(address)
            try:
                said, sampling = vf.EvalClientConfig(base_url=url), vf.SamplingConfig()
                row = task.data.model_dump(mode="json")
                return await asyncio.gather(
                    *(client.run(said, "stand-in", sampling, row) for _ in range(2))
                )
            finally:
                await client.close()

        with serving({"support-1": [[scripts["support-1"], SUBMIT]]}) as stand_in:
            episodes = asyncio.run(play(stand_in.url))
        for episode in episodes:
            (trace,) = episode.traces
            assert trace.reward == pytest.approx(1.5, rel=0.02)
        children = psutil.Process(server.pid).children(recursive=True)
        assert children
    finally:
        os.kill(server.pid, signal.SIGTERM)
        server.join(30)
    assert server.exitcode is not None
    _, alive = psutil.wait_procs(children, timeout=20)
    assert not alive
