"""Vector environments, in one process and in several."""

from functools import partial
from itertools import zip_longest

import gymnasium
import pytest
from gymnasium.vector import AsyncVectorEnv

pytestmark = pytest.mark.nightly

WAIT = '{"tool": "get_machine_summary", "arguments": {}}'
TASKS = ("lift-1", "lift-2", "support-1")


def test_each_environment_of_a_vector_plays_its_own_episode(actions, experts) -> None:
    name = "buildarena_gymnasium:BuildArena/{}-v0"
    made = [partial(gymnasium.make, name.format(t.capitalize()), simulator="mujoco") for t in TASKS]
    vector = AsyncVectorEnv(made)
    try:
        seen, info = vector.reset(seed=5)
        assert [f"# Task: {task}" in text for task, text in zip(TASKS, seen, strict=True)] == [
            True
        ] * 3
        scores, gained = {}, 0.0
        # Three submissions are tests, and the last one counts.
        told = [[*actions[task], *actions[task][-1:] * 3] for task in TASKS]
        for chosen in zip_longest(*told, fillvalue=WAIT):
            _, rewards, terminated, truncated, info = vector.step(chosen)
            gained = gained + rewards
            for index in terminated.nonzero()[0]:
                scores[TASKS[index]] = float(info["score"]["indicator"][index])
            assert not truncated.any()
        assert list(gained) == [1.0] * 3
        assert scores == {
            task: pytest.approx(experts[task]["score"]["indicator"], rel=0.02) for task in TASKS
        }
    finally:
        vector.close()
