"""Vector environments, in one process and in several."""

from __future__ import annotations

import gymnasium
import pytest
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

import buildarena_gymnasium

pytestmark = pytest.mark.nightly

WAIT = '{"tool": "get_machine_summary", "arguments": {}}'
TASKS = ("lift-1", "lift-2", "support-1")


@pytest.mark.parametrize("kind", [SyncVectorEnv, AsyncVectorEnv])
def test_each_environment_of_a_vector_plays_its_own_episode(kind, actions, experts) -> None:
    vector = kind(
        [
            lambda task=task: gymnasium.make(
                f"buildarena_gymnasium:BuildArena/{task.capitalize()}-v0", simulator="mujoco"
            )
            for task in TASKS
        ]
    )
    try:
        seen, info = vector.reset(seed=5)
        assert [f"# Task: {task}" in text for task, text in zip(TASKS, seen, strict=True)] == [
            True
        ] * 3
        scores = {}
        for number in range(max(len(actions[task]) for task in TASKS)):
            chosen = tuple(
                actions[task][number] if number < len(actions[task]) else WAIT for task in TASKS
            )
            _, rewards, terminated, truncated, info = vector.step(chosen)
            for index in terminated.nonzero()[0]:
                scores[TASKS[index]] = float(info["score"]["indicator"][index])
                assert rewards[index] == 1.0
            assert not truncated.any()
        assert scores == {
            task: pytest.approx(experts[task]["score"]["indicator"], rel=0.02) for task in TASKS
        }
    finally:
        vector.close()


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_make_vec_makes_them_by_name(mode) -> None:
    vector = gymnasium.make_vec(buildarena_gymnasium.ids()[3], 2, vectorization_mode=mode, steps=2)
    try:
        vector.reset(seed=1)
        vector.action_space.seed(1)
        for _ in range(5):
            seen, _, _, truncated, _ = vector.step(vector.action_space.sample())
            assert seen in vector.observation_space
        assert truncated.shape == (2,)
    finally:
        vector.close()


def test_a_vector_without_copies_shows_what_stands_there_now() -> None:
    name = buildarena_gymnasium.ids()[6]
    vector = AsyncVectorEnv([lambda: gymnasium.make(name)] * 2, copy=False)
    try:
        seen, _ = vector.reset()
        assert [len(text) for text in seen] == [len(text) for text in seen[:2]]
        assert "# Task: lift-1" in seen[-1]
        vector.step((WAIT, WAIT))
        assert "# Task" not in seen[0]
    finally:
        vector.close()
