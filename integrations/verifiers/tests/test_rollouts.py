"""Rollouts through verifiers' own machinery against an endpoint on loopback."""

import asyncio
from itertools import combinations

import psutil
import pytest
import verifiers.v1 as vf
from conftest import SUBMIT, without
from stand_in import serving

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.environment import Environment, NothingToSubmitError, call, try_machine
from buildarena_geometry import Machine
from buildarena_verifiers import load_environment
from buildarena_verifiers.harness import MAX_REMINDERS


def context(url: str) -> vf.ModelContext:
    client, sampling = vf.EvalClientConfig(base_url=url), vf.SamplingConfig()
    return vf.ModelContext(client=client, model="stand-in", sampling=sampling)


def played(environment, url: str, rollouts: int = 1) -> list[vf.Trace]:
    """Traces of all rows, each played so often, all at once."""

    async def play() -> list[vf.Trace]:
        async with environment.serving():
            slots = [
                slot for task in environment.taskset for slot in environment.slots(task, rollouts)
            ]
            episodes = await asyncio.gather(
                *(environment.run_slot(slot, context(url)) for slot in slots)
            )
        return [trace for episode in episodes for trace in episode.traces]

    return asyncio.run(play())


def expected(task: str, script):
    """What a script's machine scores when it is built and tried here."""
    environment = Environment(task)
    for made in script:
        if made != SUBMIT:
            call(environment, made["tool"], made["arguments"])
    try:
        machine = environment.submitted()
    except NothingToSubmitError:
        machine = Machine()
    return machine, try_machine(builtin_tasks()[task], machine).score


def several(script, at_once: int = 6):
    """The script with several calls in each reply."""
    return [script[first : first + at_once] for first in range(0, len(script), at_once)]


def engines() -> list[psutil.Process]:
    return [p for p in psutil.Process().children() if "spawn_main" in " ".join(p.cmdline())]


def record(trace) -> dict:
    return trace.info["buildarena"]


@pytest.mark.nightly
def test_the_expert_earns_the_services_scores_in_all_tasks(scripts, experts) -> None:
    environment = load_environment(simulator="mujoco", rewards={"success": 1.0, "indicator": 0.5})
    whole = {task: [several([*script, SUBMIT])] for task, script in scripts.items()}
    with serving(whole) as stand_in:
        traces = played(environment, stand_in.url)
    assert [record(trace)["task"] for trace in traces] == list(builtin_tasks())
    for trace in traces:
        kept = experts[record(trace)["task"]]["score"]
        assert trace.ok, trace.errors
        assert record(trace)["score"]["success"]
        assert record(trace)["score"]["flags"] == kept["flags"]
        assert record(trace)["score"]["indicator"] == pytest.approx(kept["indicator"], rel=0.02)
        assert trace.rewards["success"].value == 1.0
        assert trace.reward == pytest.approx(1.5, rel=0.02)
        assert trace.rewards["constraint_progress"].value == 0.0
        assert trace.rewards["constraint_progress"].score == 1.0


def test_16_rollouts_at_once_earn_what_their_own_machines_score(scripts) -> None:
    built = scripts["lift-1"]
    pairs = list(combinations(range(2, len(built)), 2))[:16]
    variants = [without(built, *pair) for pair in pairs]
    environment = load_environment("lift-1", rewards={"indicator": 1.0}, processes=2)
    with serving({"lift-1": [several(script) for script in variants]}) as stand_in:
        traces = played(environment, stand_in.url, rollouts=16)
    assert len(traces) == 16
    assert all(trace.ok for trace in traces)
    played_ones = set()
    for trace in traces:
        (first, *_) = [node.message for node in trace.nodes if node.message.role == "assistant"]
        number = int(first.tool_calls[0].id.split("-")[1])
        played_ones.add(number)
        machine, score = expected("lift-1", variants[number])
        found = record(trace)
        assert Machine.from_document(found["machine"]).log == (
            Machine.from_document(machine.to_document()).log
        )
        told = (found["score"]["indicator"], found["score"]["success"])
        assert told == (score.indicator, score.success)
        assert found["score"]["flags"] == list(score.flags)
    assert len(played_ones) == 16
    assert len({record(trace)["score"]["indicator"] for trace in traces}) > 3
    assert not engines()


@pytest.mark.parametrize("ending", ["turns", "talk", "silence"])
def test_what_ends_a_rollout_early_has_its_machine_tried(ending, scripts) -> None:
    script = scripts["lift-1"]
    environment = load_environment("lift-1", steps=len(script) if ending == "silence" else 2000)
    if ending == "turns":
        agent = environment.config.agent.model_copy(update={"max_turns": len(script)})
        changed = environment.config.model_copy(update={"agent": agent})
        environment = vf.load_environment(changed)
    with serving({"lift-1": [script]}) as stand_in:
        (trace,) = played(environment, stand_in.url)
    assert trace.ok, trace.errors
    assert trace.reward == 1.0
    assert trace.stop_condition == ("max_turns" if ending == "turns" else "agent_completed")
    talk = {"turns": 0, "talk": MAX_REMINDERS + 1, "silence": 0}
    assert trace.num_turns == len(script) + talk[ending]


@pytest.mark.nightly
def test_an_agent_out_of_time_has_its_machine_tried(scripts) -> None:
    config = load_environment("lift-1").config
    agent = config.agent.model_copy(
        update={"timeout": config.agent.timeout.model_copy(update={"rollout": 4.0})}
    )
    environment = vf.load_environment(config.model_copy(update={"agent": agent}))
    with serving({"lift-1": [[scripts["lift-1"], 8.0]]}) as stand_in:
        (trace,) = played(environment, stand_in.url)
    assert (trace.ok, trace.is_timeout, trace.reward) == (True, True, 1.0)


def test_a_kept_trace_is_scored_again_without_physics(scripts) -> None:
    environment = load_environment("lift-1")
    with serving({"lift-1": [several([*scripts["lift-1"], SUBMIT])]}) as stand_in:
        (trace,) = played(environment, stand_in.url)
    kept = vf.WireTrace.model_validate_json(trace.model_dump_json())
    kept.rewards.clear()
    weighed = load_environment("lift-1", rewards={"indicator": 2.0})
    (task,) = weighed.taskset
    asyncio.run(task.score(kept))
    assert kept.reward == pytest.approx(2.0, rel=0.02)
    assert kept.rewards["success"].score == 1.0
    assert kept.metrics["parts"] == record(trace)["score"]["metrics"]["parts"]


def test_whatever_a_model_calls_is_answered() -> None:
    script = [
        SUBMIT,
        {"tool": "fly", "arguments": "{}"},
        {"tool": "start", "arguments": "not JSON"},
        {"tool": "start", "arguments": "[" * 500},
        {"tool": "start", "arguments": '{"machine": 7}'},
        [{"tool": "start", "arguments": ""}, {"tool": "start", "arguments": {}}],
        "Let me think.",
        [SUBMIT, SUBMIT],
    ]
    with serving({"support-2": [script]}) as stand_in:
        (trace,) = played(load_environment("support-2"), stand_in.url)
    assert trace.ok, trace.errors
    assert record(trace)["refused"] == 6
    assert record(trace)["steps"] == 7
    assert (record(trace)["trials"], trace.reward) == (3, 0.0), "two test trials, and the end"
    assert trace.metrics["refused"] == 6


def test_starts_are_rows() -> None:
    environment = load_environment(["lift-1", "support_1"], start_seeds=[1, 2])
    rows = [(task.data.name, task.data.task, task.data.start_seed) for task in environment.taskset]
    assert rows == [
        ("lift-1 from 1", "lift-1", 1),
        ("lift-1 from 2", "lift-1", 2),
        ("support-1 from 1", "support-1", 1),
        ("support-1 from 2", "support-1", 2),
    ]


def test_what_does_not_exist_is_named() -> None:
    for arguments, said in (
        ({"tasks": "support-9"}, "unknown task 'support-9'"),
        ({"rounds": 0}, "rounds"),
    ):
        with pytest.raises(ValueError, match=said):
            load_environment(**arguments)
