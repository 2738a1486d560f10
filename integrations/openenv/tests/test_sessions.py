"""Episodes over OpenEnv's protocol, several at once."""

from __future__ import annotations

import asyncio
import importlib
import json
import os
import signal
import urllib.request
from pathlib import Path

import psutil
import pytest
import yaml
from fastapi import FastAPI
from openenv.validation.parsers.openenv_yaml import OpenEnvYamlParser

from buildarena_environment import UnknownChoiceError
from buildarena_environment.rewards import DEFAULT_WEIGHTS
from buildarena_openenv import BuildAction, BuildClient
from buildarena_openenv import server as module
from buildarena_openenv.environment import Terms
from buildarena_openenv.server import build_app

ROOM = Path(__file__).parents[1]
TASKS = ("support-1", "lift-1", "lift-2", "transport-1")


def actions(experts, task: str) -> list[BuildAction]:
    return [
        BuildAction(tool=made["tool"], arguments={**made["arguments"], "machine": made["machine"]})
        for made in experts[task]["calls"]
    ]


async def built(client: BuildClient, experts, task: str):
    await client.reset(task=task, episode_id=f"the {task}")
    for action in actions(experts, task):
        result = await client.step(action)
        assert result.observation.accepted, result.observation.text


def test_sessions_at_once_play_their_own_episodes(server, experts) -> None:
    async def play(task: str):
        async with BuildClient(base_url=server[0]) as client:
            await built(client, experts, task)
            state = await client.state()
            assert (state.task, state.episode_id) == (task, f"the {task}")
            assert state.step_count == len(experts[task]["calls"])
            result = await client.step(BuildAction(tool="submit"))
            assert (await client.state()).done
            return result

    async def play_all():
        return await asyncio.gather(*(play(task) for task in TASKS + TASKS[:2]))

    for task, result in zip(TASKS + TASKS[:2], asyncio.run(play_all()), strict=True):
        kept = experts[task]["score"]
        assert (result.done, result.reward) == (True, 1.0)
        assert result.observation.score["success"]
        assert result.observation.score["indicator"] == pytest.approx(kept["indicator"], rel=0.02)
        assert result.observation.score["flags"] == kept["flags"]
        assert "It succeeded." in result.observation.text


def test_a_synchronous_client_reads_the_briefing_and_begins_again(server) -> None:
    with BuildClient(base_url=server[0]).sync() as client:
        first = client.reset(task="support_1", seed=4, steps=2)
        assert "# Task: support-1" in first.observation.text
        assert first.observation.tools[-1]["name"] == "submit"
        assert client.state().start_seed == 4
        client.step(BuildAction(tool="start"))
        last = client.step(BuildAction(tool="fly"))
        assert (last.done, last.observation.truncated, last.observation.accepted) == (
            True,
            True,
            False,
        )
        assert last.observation.score["reason"] == "empty_machine"
        with pytest.raises(RuntimeError, match="reset begins another"):
            client.step(BuildAction(tool="start"))
        client.reset()
        assert (client.state().machines, client.state().steps_left) == ({}, 300)


def test_a_killed_engine_costs_one_trial_and_no_session(server, experts) -> None:
    async def play() -> None:
        async with BuildClient(base_url=server[0]) as one, BuildClient(base_url=server[0]) as other:
            await built(one, experts, "transport-1")
            await built(other, experts, "lift-1")
            await other.step(BuildAction(tool="submit"))
            (engine,) = [
                child
                for child in psutil.Process(server[1].pid).children(recursive=True)
                if "spawn_main" in " ".join(child.cmdline())
            ]
            # Stopped, it can't be done before it is killed.
            engine.suspend()
            asyncio.get_running_loop().call_later(0.5, os.kill, engine.pid, signal.SIGKILL)
            with pytest.raises(RuntimeError, match="ended with code -9"):
                await one.step(BuildAction(tool="submit"))
            assert not (await one.state()).done
            result = await one.step(BuildAction(tool="submit"))
            assert (result.done, result.reward) == (True, 1.0)

    asyncio.run(play())


def test_a_server_that_stops_leaves_no_process(serving) -> None:
    with serving("--processes", "2") as (url, process):
        with BuildClient(base_url=url).sync() as client:
            client.reset(task="lift-1")
            client.step(BuildAction(tool="start"))
            client.step(BuildAction(tool="submit"))
        children = psutil.Process(process.pid).children(recursive=True)
        assert children
    _, alive = psutil.wait_procs(children, timeout=10)
    assert not alive


def test_the_schema_and_metadata_are_published(server) -> None:
    def read(path: str):
        with urllib.request.urlopen(server[0] + path, timeout=10) as answer:
            return json.load(answer)

    assert read("/metadata")["name"] == "buildarena"
    schema = read("/schema")
    assert set(schema["action"]["properties"]) == {"tool", "arguments", "metadata"}
    assert "steps_left" in schema["state"]["properties"]


def test_what_a_server_is_asked_to_offer_is_checked_at_its_start() -> None:
    with pytest.raises(UnknownChoiceError, match="no task 'support-9'"):
        build_app(Terms(task="support-9"))
    with pytest.raises(ValueError, match="from 1 to 0"):
        build_app(Terms(max_steps=0))
    with pytest.raises(ValueError, match="processes is 0"):
        build_app(processes=0)


def test_the_description_is_one_that_openenv_reads() -> None:
    manifest = OpenEnvYamlParser().parse(ROOM)
    assert manifest.name == "buildarena"
    assert DEFAULT_WEIGHTS.keys() == {"success"}
    assert manifest.reward.range == (0.0, DEFAULT_WEIGHTS["success"])
    module, _, name = yaml.safe_load((ROOM / "openenv.yaml").read_text())["app"].partition(":")
    assert isinstance(getattr(importlib.import_module(module), name), FastAPI)


def test_weights_of_rewards_are_named_where_the_server_starts(monkeypatch, capsys) -> None:
    offered: list[Terms] = []
    monkeypatch.setattr(module, "build_app", lambda terms, **_: offered.append(terms))
    monkeypatch.setattr(module.uvicorn, "run", lambda *_, **__: None)
    module.main(["--reward", "success=1", "--reward", "indicator=0.5"])
    module.main([])
    assert [terms.rewards for terms in offered] == [{"success": 1.0, "indicator": 0.5}, None]
    for wrong in ("indicator", "indicator=much", "indicator=nan"):
        with pytest.raises(SystemExit) as ended:
            module.main(["--reward", wrong])
        assert ended.value.code == 2
        assert "expected NAME=WEIGHT" in capsys.readouterr().err
    monkeypatch.undo()
    with pytest.raises(SystemExit):
        module.main(["--reward", "beauty=1"])
    assert "constraint_progress" in capsys.readouterr().err
