"""Episodes through Gymnasium's own doors."""

import json

import gymnasium
import numpy as np
import pytest
from gymnasium.error import InvalidAction, ResetNeeded
from gymnasium.utils.env_checker import check_env

import buildarena_gymnasium
from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.environment import SnapshotError, UnknownChoiceError
from buildarena_gymnasium.spaces import MAX_OBSERVATION, UNKNOWN, observe

SUBMIT = '{"tool": "submit"}'
START = '{"tool": "start", "arguments": {}}'
IDS = buildarena_gymnasium.ids()
EACH = [pytest.param(n, marks=() if n == IDS[4] else pytest.mark.nightly) for n in IDS]


def task_of(name: str) -> str:
    return name.split("/")[1].removesuffix("-v0").lower()


def test_all_tasks_are_registered_and_registering_twice_is_quiet() -> None:
    buildarena_gymnasium.register_all()
    assert len(IDS) == len(builtin_tasks())
    assert IDS[4] == "BuildArena/Support-1-v0"
    found = gymnasium.make("buildarena_gymnasium:BuildArena/Lift-3-v0")
    assert found.unwrapped.environment.task.name == "lift-3"


@pytest.mark.parametrize("name", EACH)
def test_gymnasiums_checker_is_content(name) -> None:
    check_env(gymnasium.make(name, render_mode="rgb_array").unwrapped)


@pytest.mark.parametrize("name", EACH)
def test_the_expert_scores_what_it_scores_elsewhere(name, actions, experts) -> None:
    task = task_of(name)
    rewards = {"success": 1.0, "indicator": 2.0}
    environment = gymnasium.make(name, simulator="mujoco", rewards=rewards)
    briefing, info = environment.reset(seed=3)
    assert f"# Task: {task}" in briefing
    assert UNKNOWN * 2 not in briefing
    assert json.loads(info["tools"])[-1]["name"] == "submit"
    total = 0.0
    # Where there are test trials, the machine stays as it is until the one that counts.
    for action in [*actions[task], *([SUBMIT] * builtin_tasks()[task].test_trials)]:
        observation, reward, terminated, truncated, info = environment.step(action)
        assert info["accepted"], observation
        total += reward
    assert (terminated, truncated) == (True, False)
    kept = experts[task]["score"]
    assert info["score"]["success"] == kept["success"]
    assert info["score"]["indicator"] == pytest.approx(kept["indicator"], rel=0.02)
    assert info["score"]["flags"] == kept["flags"]
    assert total == pytest.approx(3.0, rel=0.02)
    with pytest.raises(ResetNeeded):
        environment.step(SUBMIT)


def test_nonsense_is_answered_inside_the_spaces() -> None:
    environment = gymnasium.make(IDS[4], steps=50).unwrapped
    environment.reset()
    space = environment.observation_space
    for action in (
        "",
        "x" * 10_000_000,
        "\0\N{SNOWMAN}",
        '{"tool": "\N{SNOWMAN}\\u2603", "arguments": {}}',
        '{"tool": "start", "arguments": {"machine": "\\ud800"}}',
        json.dumps({"tool": "start", "arguments": {"note": "a" * 3000}}),
    ):
        observation, reward, terminated, truncated, info = environment.step(action)
        assert observation in space
        assert (reward, terminated, truncated, info["accepted"]) == (0.0, False, False, False)
    observation, *_ = environment.step("x" * 80_001)
    assert observation == "the call has 80,001 characters: at most 80,000 are read"
    with pytest.raises(InvalidAction, match="an action is text, not int"):
        environment.step(3)
    assert observe("\N{SNOWMAN}!") == "?!"
    assert len(observe("a" * 10**6)) == MAX_OBSERVATION
    assert observe("a" * 10**6).endswith(" [cut]")


def test_the_last_step_has_what_was_built_tried(actions) -> None:
    built = actions["support-1"][:-1]
    environment = gymnasium.make(IDS[4], steps=len(built))
    environment.reset()
    *_, last = [environment.step(action) for action in built]
    observation, reward, terminated, truncated, info = last
    assert (reward, terminated, truncated) == (1.0, False, True)
    assert info["score"]["success"]
    assert "It succeeded." in observation
    observation, _ = environment.reset()
    assert observation.startswith("# How you play")


def test_states_are_reached_again_and_lead_to_the_same(actions) -> None:
    built = actions["lift-1"]
    environment = gymnasium.make(IDS[8])
    environment.reset()
    for action in built[:-4]:
        environment.step(action)
    builder = environment.unwrapped
    state = builder.state()
    first = [environment.step(action) for action in built[-4:]]
    builder.restore(state)
    second = [environment.step(action) for action in built[-4:]]
    assert first == second
    other = gymnasium.make(IDS[8])
    other.reset(options={"state": json.loads(json.dumps(state.as_document()))})
    assert [other.step(action)[:4] for action in built[-4:]] == [step[:4] for step in first]
    with pytest.raises(SnapshotError, match="is of lift-1"):
        gymnasium.make(IDS[0]).reset(options={"state": state})


@pytest.mark.nightly
def test_starts_vary_when_asked_for_and_only_then(actions) -> None:
    def indicator(environment, **options) -> float:
        environment.reset(**options)
        return [environment.step(action) for action in actions["transport-1"]][-1][4]["score"][
            "indicator"
        ]

    exact = gymnasium.make(IDS[0], simulator="mujoco")
    assert indicator(exact, seed=1) == indicator(exact, seed=2) == indicator(exact)
    varied = gymnasium.make(IDS[0], simulator="mujoco", varied_start=True)
    first, second = indicator(varied, seed=1), indicator(varied)
    assert len({first, second, indicator(exact)}) == 3
    assert (indicator(varied, seed=1), indicator(varied)) == (first, second)
    chosen = indicator(exact, options={"start_seed": 7})
    assert chosen == indicator(varied, options={"start_seed": 7}) != indicator(exact)


def test_what_does_not_exist_is_named_with_the_choices() -> None:
    with pytest.raises(UnknownChoiceError, match="unknown simulator 'game'"):
        gymnasium.make(IDS[0], simulator="game")
    with pytest.raises(ValueError, match="unknown option 'sede'; valid options: state, start_seed"):
        gymnasium.make(IDS[0]).reset(options={"sede": 1})
    with pytest.raises(ValueError, match="unknown render mode 'film'"):
        buildarena_gymnasium.BuildEnv("support-1", render_mode="film")
    with pytest.raises(ResetNeeded):
        buildarena_gymnasium.BuildEnv("support-1").step(START)


def test_pictures_show_what_was_built(actions) -> None:
    environment = gymnasium.make(IDS[4], render_mode="rgb_array")
    environment.reset()
    empty = environment.render()
    assert (empty.shape, empty.dtype) == ((320, 480, 3), np.uint8)
    assert (empty == 255).all()
    for action in actions["support-1"][:-1]:
        environment.step(action)
    shown = environment.render()
    assert shown.shape == empty.shape
    assert len(np.unique(shown.reshape(-1, 3), axis=0)) > 5
