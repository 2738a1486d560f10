"""The example that learns: repeatable, and its best bridge is as good as the page says."""

from __future__ import annotations

import csv
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.machines.expert_calls import calls_of

from buildarena_benchmark import broken_constraint, builtin_tasks
from buildarena_environment import Environment, try_machine
from buildarena_geometry import Machine

pytestmark = pytest.mark.nightly

ROOT = Path(__file__).parents[2]
EXAMPLE, KEPT = ROOT / "examples/learning", ROOT / "docs/learning"


@pytest.fixture
def example(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLE))
    import learn_bridge

    yield learn_bridge
    for name in ("learn_bridge", "policy"):
        sys.modules.pop(name, None)


def test_the_same_seed_learns_the_same_with_any_number_of_processes(example) -> None:
    told = []
    for processes in (1, 2):
        history, kept = example.learn(
            seed=3, generations=2, minutes=60, bridges=4, processes=processes
        )
        document = kept[0].machine.to_document()
        told.append(([replace(one, minutes=0.0) for one in history], document))
    assert told[0] == told[1]
    assert [one.trials for one in told[0][0]] == [4, 8]


def test_a_policy_moves_towards_what_was_good_and_gives_nothing_up(example) -> None:
    ignorant = example.Policy.ignorant()
    draw = np.random.default_rng(0)
    wide = [replace(ignorant.sample(draw), rows=2, north=4) for _ in range(3)]
    policy = ignorant
    for _ in range(20):
        policy = policy.towards(wide, step=0.4, floor=0.004)
    assert policy.rows[2] > 0.95
    for shares in (policy.north, policy.south, policy.rows):
        assert shares.sum() == pytest.approx(1.0)
        assert shares.min() > 0.003
    everywhere = np.all([one.braces for one in wide], axis=0)
    assert policy.braces.max() <= 1 - 0.004
    assert policy.braces.min() >= 0.004 - 1e-9
    assert not everywhere.any() or policy.braces[everywhere].min() > 0.9


def test_refused_choices_are_left_out_of_a_bridge(example) -> None:
    environment = Environment("support-1")
    ignorant = example.Policy.ignorant()
    crowded = replace(
        ignorant.sample(np.random.default_rng(1)),
        braces=np.ones_like(ignorant.braces, dtype=bool),
        ties=np.ones_like(ignorant.ties, dtype=bool),
        rows=2,
    )
    example.built(environment, crowded)
    machine = environment.machines["main"]
    assert broken_constraint(environment.task, machine) is None
    assert {link.module.name for link in machine.connectors.values()} == {"Brace"}


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_the_learned_bridge_beats_the_expert(engine) -> None:
    pytest.importorskip(engine)
    machine = Machine.from_document(json.loads((KEPT / "bridge.machine.json").read_text()))
    expert = Environment("support-1")
    for call in calls_of("support-1"):
        assert expert.step(call["tool"], call["arguments"]).ok
    task = builtin_tasks()["support-1"]
    learned = try_machine(task, machine, engine)
    assert learned.counts
    assert learned.reason is None
    assert set(learned.score.flags) <= {"never_fell"}
    assert learned.score.metrics["floor_share"] < 0.02
    assert learned.score.metrics["least_terrain_share"] > 0.4
    before = try_machine(task, expert.machines["main"], engine)
    assert learned.score.indicator > before.score.indicator
    kept = json.loads((KEPT / "verdicts.json").read_text())[engine]
    assert learned.score.indicator == pytest.approx(kept["indicator"], rel=0.02)


def test_the_curve_is_of_rewards_that_rise() -> None:
    with (KEPT / "curve.csv").open(newline="") as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    assert [row["number"] for row in rows] == list(range(1, len(rows) + 1))
    assert rows[-1]["minutes"] < 60
    assert rows[0]["best"] < 1.0 < rows[-1]["best"]
    assert np.mean([row["mean"] for row in rows[-5:]]) > 3 * rows[0]["mean"]


@pytest.fixture
def languages(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLE / "grpo"))
    import languages

    yield languages.LANGUAGES
    sys.modules.pop("languages", None)


RUNS = sorted(KEPT.glob("*.seed-*.json"))


@pytest.mark.parametrize("kept", RUNS, ids=lambda kept: kept.stem)
def test_the_curves_of_messages_rise(kept) -> None:
    run = json.loads(kept.read_text())
    means = [row["mean"] for row in run["updates"]]
    assert len(means) == run["setting"]["updates"]
    tenth = max(1, len(means) // 10)
    assert np.mean(means[-tenth:]) > max(0.3, 4 * np.mean(means[:tenth]))
    assert run["tests"]["after"]["mean"] > 4 * run["tests"]["before"]["mean"]


@pytest.mark.parametrize("kept", RUNS, ids=lambda kept: kept.stem)
def test_the_best_message_earns_what_its_run_says(kept, languages) -> None:
    run = json.loads(kept.read_text())
    setting = run["setting"]
    pytest.importorskip(setting["simulator"])
    language = languages[setting["task"]]
    calls = [*language.opening, *language.calls(run["best"]["written"].split(" "))]

    def earned(start: int) -> float:
        environment = Environment(
            setting["task"], setting["simulator"], seed=start, rewards={"indicator": 1.0}
        )
        for made in calls[:-1]:
            environment.step(made.tool, dict(made.arguments))
        environment.submit()
        return environment.reward

    # It was the best from one of the starts that the run was trained on.
    assert any(earned(start) == pytest.approx(run["best"]["reward"]) for start in range(1, 9))


def test_there_are_two_seeds_of_each_task() -> None:
    tasks = [kept.name.split(".")[0] for kept in RUNS]
    assert {task: tasks.count(task) for task in tasks} == {"balance-1": 2, "support-1": 2}
