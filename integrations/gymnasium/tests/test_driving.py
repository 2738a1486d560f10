"""Episodes in which the agent is the controller of a fixed machine."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.error import InvalidAction, ResetNeeded
from gymnasium.utils.env_checker import check_env

import buildarena_gymnasium
from buildarena_benchmark import builtin_tasks, score
from buildarena_benchmark.environment import UnknownChoiceError
from buildarena_gymnasium import DriveEnv
from buildarena_gymnasium.drive_env import fixed_machine, fixed_machines
from buildarena_simulation import SimulationError, simulate, write_trajectory
from buildarena_simulation.controllers.program import Program
from buildarena_simulation.trial import Trial

pytestmark = pytest.mark.nightly

IDS = buildarena_gymnasium.drive_ids()
HOVER = builtin_tasks()["hover-4"]
SHORT = replace(HOVER, scenario=HOVER.scenario.model_copy(update={"duration_s": 6.0}))
TICKS = 150


def short(**arguments) -> DriveEnv:
    return DriveEnv(SHORT, **{"simulator": "mujoco", **arguments})


def rising(environment: gymnasium.Env) -> np.ndarray:
    return np.full(environment.action_space.shape, 0.37)


def to_the_end(environment: gymnasium.Env, action: np.ndarray | None = None) -> list:
    """Every step of the episode that has begun."""
    steps, ended = [], False
    while not ended:
        steps.append(environment.step(rising(environment) if action is None else action))
        ended = steps[-1][2] or steps[-1][3]
    return steps


def written(trajectory) -> bytes:
    """The whole of it, but for which program acted."""
    settings = {name: value for name, value in trajectory.settings.items() if name != "controller"}
    return write_trajectory(replace(trajectory, settings=settings))


def test_each_task_that_takes_programs_can_be_driven() -> None:
    piloted = [name for name, task in builtin_tasks().items() if task.scenario.senses]
    assert list(fixed_machines()) == piloted
    assert "BuildArena/Drive-Hover-4-v0" in IDS
    assert len(IDS) == len(piloted)
    usual = gymnasium.make("buildarena_gymnasium:BuildArena/Drive-v0").unwrapped
    assert usual.task.name == "hover-4"
    assert gymnasium.make("BuildArena/Drive-v0", task="slalom-2").unwrapped.task.level == 2


@pytest.mark.parametrize("name", [IDS[0], IDS[-1]])
@pytest.mark.filterwarnings("ignore:.*A Box observation space m")  # places have no bounds
def test_gymnasiums_checker_is_content(name) -> None:
    check_env(gymnasium.make(name, simulator="mujoco", render_mode="rgb_array").unwrapped)


@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
@pytest.mark.parametrize("seed", [None, 3])
def test_what_a_program_answers_makes_its_trial(engine, seed, experts, monkeypatch) -> None:
    calls = experts["hover-4"]["calls"]
    (program,) = (c["arguments"]["program"] for c in calls if c["tool"] == "set_controller")
    answers, answer = [], Program.answer

    def listened(*tick) -> dict[str, float]:
        answers.append(answer(*tick))
        return answers[-1]

    monkeypatch.setattr(Program, "answer", listened)
    machine = fixed_machine("hover-4").with_controller(program)
    trajectory = simulate(machine, SHORT.scenario, engine, seed=seed)
    assert len(answers) == TICKS

    environment = short(simulator=engine)
    seen, _ = environment.reset(seed=seed)
    for tick, named in enumerate(answers):
        assert np.array_equal(seen.astype(np.float32), trajectory.piloting.senses[tick])
        action = np.array([named[name] for name in environment.action_names])
        seen, _, terminated, truncated, info = environment.step(action)
    assert (terminated, truncated) == (True, False)
    trial = environment.trial
    assert trial.trajectory.positions.tobytes() == trajectory.positions.tobytes()
    assert written(trial.trajectory) == written(trajectory)
    assert trial.score == score(SHORT, machine, trajectory)
    assert info["score"]["indicator"] == trial.score.indicator


def test_rewards_are_of_the_trial_alone() -> None:
    # Within 30 of the mark is near enough here, and everything counts.
    easy = SHORT.scoring.model_copy(update={"radius": 30.0})
    task = replace(SHORT, scoring=easy)
    rewards = {"success": 1, "indicator": 2}
    environment = DriveEnv(task, simulator="mujoco", rewards=rewards, reference=0.5)
    environment.reset()
    _, reward, *_, info = to_the_end(environment, np.full(4, 0.37))[-1]
    assert info["score"]["success"]
    assert reward == pytest.approx(1 + 2 * info["score"]["indicator"] / 0.5)
    choices = "unknown reward 'accepted_share': choose from ind"
    with pytest.raises(UnknownChoiceError, match=choices):
        short(rewards={"accepted_share": 1.0})
    with pytest.raises(ValueError, match="no reference indicator"):
        short(rewards={"indicator": 1.0})


def test_the_same_seed_and_actions_have_the_same_bytes() -> None:
    def played(environment: DriveEnv, seed: int) -> tuple[bytes, bytes]:
        environment.reset(seed=seed)
        environment.action_space.seed(5)
        actions = [environment.action_space.sample() for _ in range(TICKS)]
        seen = [environment.step(action)[0] for action in actions]
        return np.array(seen).tobytes(), written(environment.trial.trajectory)

    first, other = short(), short()
    once = played(first, 7)
    other.reset(seed=8)  # an episode that is left behind changes nothing
    other.step(rising(other))
    assert played(other, 7) == once == played(first, 7)
    assert played(first, 8) != once


def test_worlds_are_the_exact_one_or_of_a_seed_or_drawn() -> None:
    def mark(seen: np.ndarray) -> tuple[float, ...]:
        first = short().sense_names.index("marks.goal.position.x")
        return tuple(seen[first : first + 3])

    exact = short()
    seen, info = exact.reset()
    assert mark(seen) == (4, -3, 12)
    assert info == {"time_s": 0.0}
    seen, info = exact.reset(seed=9)
    assert info["world_seed"] == 9
    assert mark(seen) == SHORT.scenario.world(9).marks[0].center
    assert mark(exact.reset()[0]) == (4, -3, 12)
    varied = short(varied_worlds=True)
    drawn = [varied.reset(seed=9)[1], varied.reset()[1], varied.reset()[1]]
    assert len({info["world_seed"] for info in drawn}) == 3
    assert [varied.reset(seed=9)[1], varied.reset()[1], varied.reset()[1]] == drawn


def test_a_machine_that_blows_up_truncates_the_episode(monkeypatch) -> None:
    environment = short()
    environment.reset()
    before, *_ = environment.step(rising(environment))
    kind = type(environment._drive._rollout._adapter)
    motion = kind.motion

    def exploding(engine):
        now = motion(engine)
        return replace(now, position=now.position * np.nan)

    monkeypatch.setattr(kind, "motion", exploding)
    seen, reward, terminated, truncated, info = environment.step(rising(environment))
    assert (reward, terminated, truncated) == (0.0, False, True)
    assert np.array_equal(seen, before)
    assert "unstable" in info["score"]["flags"]
    assert not info["score"]["success"]


def test_what_cannot_be_driven_is_refused_with_the_choices() -> None:
    with pytest.raises(UnknownChoiceError, match="unknown task 'hover-9'"):
        gymnasium.make("BuildArena/Drive-v0", task="hover-9")
    with pytest.raises(ValueError, match="support-1 offers no senses; valid tasks: transport-4"):
        DriveEnv("support-1")
    with pytest.raises(UnknownChoiceError, match="unknown simulator 'game'"):
        DriveEnv(simulator="game")
    with pytest.raises(UnknownChoiceError, match="driven in task 'mine': choose from transport-4"):
        DriveEnv(replace(HOVER, name="mine"))
    with pytest.raises(ValueError, match="unknown render mode 'film'"):
        DriveEnv(render_mode="film")
    with pytest.raises(ValueError, match="unknown option 'state'"):
        short().reset(options={"state": 1})
    # Wheels are not modules of this task.
    with pytest.raises(ValueError, match="not allowed in hover-4: "):
        DriveEnv(machine=fixed_machine("slalom-2"))


def test_what_is_no_action_is_refused_and_no_tick_passes() -> None:
    environment = short()
    environment.reset(seed=2)
    environment.step(rising(environment))
    for action, words in [
        (np.full(3, 0.5), "an action is 4 numbers, of 4.fly, 7.fly, 10.fly, 13.fly; not an array"),
        (np.array([0.5, np.nan, 0.5, 0.5]), "the action for 7.fly is not a number"),
        (np.array(["1"] * 4), "not an array of <U1"),
        ([0.5, [0.5], 0.5, 0.5], "not list"),
        ({"4.fly": 1.0}, "not dict"),
        (None, "not NoneType"),
    ]:
        with pytest.raises(InvalidAction, match=words):
            environment.step(action)
    assert environment.step(rising(environment))[4]["time_s"] == pytest.approx(0.08)


def test_steps_outside_of_an_episode_need_a_reset_also_after_a_lost_simulator(monkeypatch) -> None:
    environment = short(render_mode="rgb_array")

    def needs_reset() -> None:
        for doing in (lambda: environment.step(np.zeros(4)), environment.render):
            with pytest.raises(ResetNeeded):
                doing()

    needs_reset()
    environment.reset()
    with monkeypatch.context() as broken:
        broken.setattr(Trial, "pass_tick", lambda _: 1 / 0)
        with pytest.raises(SimulationError, match="division by zero"):
            environment.step(np.zeros(4))
    with pytest.raises(ResetNeeded):
        environment.step(np.zeros(4))
    environment.reset()
    begun = environment.render()
    assert (begun.shape, begun.dtype) == ((320, 480, 3), np.uint8)
    assert len(to_the_end(environment)) == TICKS
    assert not np.array_equal(environment.render(), begun)
    with pytest.raises(ResetNeeded):
        environment.step(np.zeros(4))
    environment.close()
    environment.close()
