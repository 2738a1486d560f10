"""The built-in models: the expert succeeds, others fail, kept sessions replay."""

import os
from dataclasses import replace
from decimal import Decimal
from typing import Any

import pytest
from support.documents.kept_sessions import (
    SCRIPTED,
    SESSIONS,
    described,
    digest_of,
    played_again,
    transcript_of,
)
from support.marks import nightly

from buildarena_backend.journal.journal import JournalEntry, Usage
from buildarena_benchmark import builtin_tasks, score
from buildarena_simulation import simulate
from buildarena_worker.session.results import Failed

TASKS = sorted(builtin_tasks())
SEEDS = range(int(os.environ.get("EXPERT_SEEDS", "1")))
ON_PYBULLET = ["flight-3", "lift-3", "support-1", "transport-1", "mechanisms-1"]
"""One task of each category; PyBullet takes several times as long, the rest is nightly."""
TRIALS = [
    (task, engine) if engine == "mujoco" or task in ON_PYBULLET else nightly(task, engine)
    for task in TASKS
    if builtin_tasks()[task].hidden_parameters is None  # those are in test_identify.py
    for engine in ("pybullet", "mujoco")
]


def tried(play, model: str, task: str, seed: int, engine: str):
    """The score of a model's machine, or the failure that kept it from being tried."""
    played = play(model, task=task, seed=seed)
    if played.suspended is None:
        return played.failure
    machine = played.suspended.machine
    drawn = builtin_tasks()[task].with_seed(seed)
    trajectory = simulate(machine, drawn.scenario, engine, controls=played.suspended.controls)
    return score(drawn, machine, trajectory)


@pytest.mark.nightly(keep=3)
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("task", "engine"), TRIALS)
def test_the_expert_succeeds(play, task, seed, engine) -> None:
    result = tried(play, "builtin/expert", task, seed, engine)
    assert not isinstance(result, Failed), result
    assert result.success, result


def test_the_other_baselines_fail(play, subtests) -> None:
    for task in TASKS:
        for model in ("builtin/random", "builtin/idle"):
            with subtests.test(task=task, model=model):
                result = tried(play, model, task, 0, "mujoco")
                assert isinstance(result, Failed) or not result.success


def entry(data: dict[str, Any]) -> JournalEntry:
    usage = {**data["usage"], "cost_usd": Decimal(data["usage"]["cost_usd"])}
    return JournalEntry(**{**data, "usage": Usage(**usage)})


def test_a_kept_session_replays_to_the_same_bytes(play, subtests) -> None:
    for resumed in [False, True]:
        for name in SESSIONS:
            with subtests.test(resumed=resumed, name=name):
                kept = SESSIONS[name]
                entries = [entry(data) for data in kept["journal"]]
                # A resumed session has a model to ask, and asks it only for what the journal lacks.
                offline = not resumed
                cut = len(entries) // 2 if resumed and name != SCRIPTED else len(entries)
                played = played_again(play, kept, entries=entries[:cut], offline=offline)
                assert described(played.result) == kept["result"]
                for one, other in zip(played.entries[:cut], entries[:cut], strict=True):
                    assert one.request_hash == other.request_hash
                if resumed:
                    # Those that kept them kept no prompts.
                    assert [
                        replace(entry, prompt_messages=None) for entry in played.entries
                    ] == entries
                assert played.session.transcript.to_json() == transcript_of(kept)
                assert played.session.transcript.refusals == kept["refusals"]
                assert digest_of(played) == kept["machine"]


def test_the_kept_sessions_end_in_every_way() -> None:
    kinds = {kept["result"]["kind"] for kept in SESSIONS.values()}
    assert kinds == {"Finished", "Suspended", "Failed"}
