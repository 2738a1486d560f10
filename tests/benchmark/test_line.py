"""A line that is followed: what must not count, whatever it looks like."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from typing import Any, Final

import numpy as np
import pytest
from support.machines.drafts import KeyedDraft
from support.machines.piloted import FASTER_FIRST, experts_machine, scored

from buildarena_benchmark import Score, TaskError, builtin_tasks, load_task, score
from buildarena_benchmark.scorers.line import LineScoring
from buildarena_geometry import Machine
from buildarena_simulation import Trajectory, simulate
from buildarena_worker.builtin.designs.drafting import EAST, NORTH, SOUTH, WEST

TASK: Final = builtin_tasks()["line-1"]


@cache
def honest(engine: str) -> tuple[Machine, Trajectory]:
    """The expert's machine, and its trial in the exact world."""
    machine = experts_machine(TASK)
    return machine, simulate(machine, TASK.scenario, engine)


def expert(*changes: tuple[str, str]) -> Machine:
    """The expert's machine, whose program does something else."""
    machine = experts_machine(TASK)
    program = machine.controller
    for before, after in changes:
        assert program.count(before) >= 1, before
        program = program.replace(before, after)
    return machine.with_controller(program)


def sides(machine: Machine, left: float, right: float) -> Machine:
    """The expert's car, whose sides are driven alike all the time."""
    program = machine.controller
    begin, end = program.index("local LEFT"), program.index("\n", program.index("local LEFT"))
    return machine.with_controller(
        program[begin:end]
        + f"""
        function control()
          local answer = {{}}
          for _, wheel in ipairs(LEFT) do answer[wheel .. ".spinning_forward"] = {left} end
          for _, wheel in ipairs(RIGHT) do answer[wheel .. ".spinning_forward"] = {right} end
          return answer
        end"""
    )


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
@pytest.mark.parametrize(
    ("left", "right"),
    [(0.6, 0.6), (-0.6, -0.6), (0.5, -0.5), (0, 0), (0.6, 0.45), (0.45, 0.6)],
    ids=["straight on", "backwards", "spinning", "standing", "right", "left"],
)
def test_what_does_not_look_follows_no_line(engine, left, right) -> None:
    machine = sides(experts_machine(TASK), left, right)
    result = scored(TASK, machine, engine, None)
    assert not result.success, result
    assert result.metrics["stretches"] <= 3
    spins = (left, right) in {(0.5, -0.5), (0, 0), (-0.6, -0.6)}
    assert result.indicator == 0 or not spins


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_who_goes_round_the_other_way_has_followed_nothing(engine) -> None:
    """A car that turns round at the start, and then follows the line with the same care."""
    turns = "function control(t, sense)\n  if t < $turn then\n    local answer = {}\n"
    turns += '    for _, wheel in ipairs(LEFT) do answer[wheel .. ".spinning_forward"] = 1 end\n'
    turns += '    for _, wheel in ipairs(RIGHT) do answer[wheel .. ".spinning_forward"] = -1 end\n'
    turns += "    return answer\n  end\n"
    metrics = []
    for seconds in ("0.5", "0.6", "0.7", "0.8", "0.9"):
        program = turns.replace("$turn", seconds)
        machine = expert(("function control(t, sense)\n", program))
        trial = simulate(machine, TASK.scenario, engine)
        result = score(TASK, machine, trial)
        ways, apart = TASK.scenario.line.nearest(trial.positions[:, 0].astype(np.float64))
        back = np.unwrap(ways, period=TASK.scenario.line.length)
        metrics.append((float(back[-1] - back[0]), float((apart < 1).mean()), result))
    backwards = [(share, of) for way, share, of in metrics if way < -40 and share > 0.8]
    assert backwards
    assert all(of.metrics["stretches"] <= 1 and not of.success for _, of in backwards)


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_a_shortcut_gains_nothing(engine) -> None:
    """It leaves the line after a while, crosses the middle, and follows the rest."""
    cuts = "function control(t, sense)\n  if t > 3 and t < 6.2 then\n    local answer = {}\n"
    cuts += "    for _, wheels in ipairs({ LEFT, RIGHT }) do for _, wheel in ipairs(wheels) do\n"
    cuts += (
        '      answer[wheel .. ".spinning_forward"] = 0.7\n    end end\n    return answer\n  end\n'
    )
    whole = score(TASK, *honest(engine))
    short = scored(TASK, expert(("function control(t, sense)\n", cuts)), engine, None)
    assert short.metrics["stretches"] <= whole.metrics["stretches"] - 2
    assert short.indicator < whole.indicator


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_back_and_forth_counts_once(engine) -> None:
    """The first part of the line, again and again."""
    shuttles = "local speed = SPEED * (t % 6 < 3 and 1 or -1)"
    machine = expert(("local speed = SPEED * (1 - 0.35 * math.min(1, math.abs(aside)))", shuttles))
    result = scored(TASK, machine, engine, None)
    assert not result.success
    assert result.metrics["stretches"] <= 4


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_a_bar_across_the_ring_that_turns_about_its_middle_follows_nothing(engine) -> None:
    """Wheels at the ends of a long bar run along the line's whole length; its middle stays."""
    draft = KeyedDraft(modules="workshop")
    end = start = draft.start()
    for _ in range(7):
        end = draft.attach(end, EAST, "Log")
    asked = []
    for base, way, share in ((start, WEST, 0.8), (draft.attach(end, EAST), EAST, -0.8)):
        for side in (NORTH, SOUTH):
            wheel = draft.wheel(draft.row(base, side, 2)[-1], way)
            asked.append(f'["{wheel}.spinning_forward"] = {share}')
    program = f"function control() return {{ {', '.join(asked)} }} end"
    machine = draft.machine.with_controller(program)
    result = scored(TASK, machine, engine, None)
    assert (result.success, result.metrics["stretches"]) == (False, 0)
    assert result.metrics["broken_joints"] == 0


@pytest.mark.nightly
@pytest.mark.parametrize("engine", FASTER_FIRST)
def test_fans_do_not_follow_a_line(engine) -> None:
    """A car whose wheels only roll, and that a fan pushes."""
    draft = KeyedDraft(modules="workshop")
    start = draft.start()
    back = draft.row(start, SOUTH, 3)[-1]
    for base in (start, back):
        for way in (EAST, WEST):
            draft.attach(draft.attach(base, way), way, "Wheel Unpowered")
    draft.attach(back, SOUTH, "Flying Block")
    machine = draft.machine.with_controller("function control() return { fly = 1 } end")
    result = scored(TASK, machine, engine, None)
    assert (result.success, result.metrics["stretches"]) == (False, 0)


@pytest.mark.nightly
def test_what_is_carried_along_the_line_without_its_wheels_is_flagged() -> None:
    """The expert's trial, in which wheels do not turn: the same way, and nothing that drove it."""
    machine, trial = honest("mujoco")
    assert score(TASK, machine, trial).success
    stiff = np.repeat(trial.quaternions[:, :1], trial.quaternions.shape[1], axis=1)
    result = score(TASK, machine, replace(trial, quaternions=stiff))
    assert (result.success, result.flags) == (False, ("not_driven",))
    assert result.indicator == 0


@pytest.mark.nightly
def test_a_wheel_that_comes_off_ends_it() -> None:
    machine, trial = honest("mujoco")
    whole = score(TASK, machine, trial)
    pieces = trial.pieces.copy()
    wheel = next(k for k, block in enumerate(trial.block_ids) if machine.blocks[block].module.motor)
    pieces[100:, wheel] = pieces.max() + 1
    lost = score(TASK, machine, replace(trial, pieces=pieces))
    assert lost.metrics["wheels_lost"]
    assert lost.metrics["stretches"] == _until(TASK, machine, trial, 100)
    assert lost.metrics["stretches"] < whole.metrics["stretches"]


def _until(task: Any, machine: Machine, trial: Trajectory, samples: int) -> int:
    """Stretches that are followed until a sample, after which the car stands."""
    positions = trial.positions.copy()
    positions[samples:] = positions[samples - 1]
    return int(score(task, machine, replace(trial, positions=positions)).metrics["stretches"])


@pytest.mark.nightly
def test_only_what_is_near_the_line_counts(subtests) -> None:
    """The expert's trial beside the line, by so much to the east: along half of it, aside."""
    for aside in [0.0, 0.9, 1.3]:
        with subtests.test(aside=aside):
            machine, trial = honest("mujoco")
            result = _beside(machine, trial, aside)
            whole = score(TASK, machine, trial).metrics["stretches"]
            assert result.metrics["stretches"] <= (whole if aside < 1 else 9)
            assert aside or result.metrics["stretches"] == whole


def _beside(machine: Machine, trial: Trajectory, aside: float) -> Score:
    shift = np.array([aside, 0.0, 0.0], dtype=trial.positions.dtype)
    return score(TASK, machine, replace(trial, positions=trial.positions + shift))


def test_the_time_ends_once_all_but_one_stretch_are_followed() -> None:
    machine, trial = honest("mujoco")
    result = score(TASK, machine, trial)
    length, time_s = result.metrics["length"], result.metrics["all_followed_s"]
    assert result.metrics["stretches"] == 11
    assert length == pytest.approx(TASK.scenario.line.length * 11 / 12, rel=1e-6)
    assert result.indicator == pytest.approx(length / time_s, rel=1e-5)
    slow = _until(TASK, machine, trial, 200)
    assert 0 < slow < 11
    positions = trial.positions.copy()
    positions[200:] = positions[199]
    stopped = score(TASK, machine, replace(trial, positions=positions))
    assert stopped.indicator == pytest.approx(stopped.metrics["length"] / 30, rel=1e-5)
    assert stopped.metrics["all_followed_s"] is None


@pytest.mark.nightly
def test_each_threshold_decides(subtests) -> None:
    for stricter in [
        {"max_distance": 0.05},
        {"stretches": 100, "min_stretches": 95, "all_stretches": 99},
    ]:
        with subtests.test(stricter=stricter):
            machine, trial = honest("mujoco")
            scoring = LineScoring(**(TASK.scoring.model_dump() | stricter))
            assert not score(replace(TASK, scoring=scoring), machine, trial).success


@pytest.mark.nightly
def test_lines_are_as_the_statement_says() -> None:
    """Of every drawn world, and of the corners of what is drawn."""
    draws = TASK.scenario.draws
    lines = [TASK.scenario.world(seed).line for seed in range(300)]
    for corner in range(64):
        ends = [(corner >> bit) & 1 for bit in range(6)]
        radius = draws["line.radius"][ends[0]]
        bends = [
            (draws[path][a][0], draws[path][b][1])
            for path, a, b in (
                ("line.bends.1", ends[1], ends[2]),
                ("line.bends.2", ends[3], ends[4]),
            )
        ]
        lines.append(lines[0].model_copy(update={"radius": radius, "bends": tuple(bends)}))
    assert min(line.length for line in lines) >= 60
    assert max(line.length for line in lines) <= 90
    assert max(line.greatest_curvature for line in lines) <= 1 / 6
    left = sum(line.side >= 0 for line in lines[:300])
    assert 100 < left < 200


def test_a_line_that_nobody_can_follow_is_refused(subtests) -> None:
    for scenario, told in [
        ({"line": None, "draws": {}}, "scenario.line is missing"),
        ({"control": {"mode": "none"}}, "control"),
        ({"line": {"radius": 12, "bends": [[0.4, 0.2]]}, "draws": {}}, "shares are 0.6 in all"),
        ({"draws": {"line.bends.3": [[0, 0], [0.1, 0.1]]}}, "there is no '3'"),
    ]:
        with subtests.test(scenario=scenario), pytest.raises(TaskError, match=told):
            load_task(_changed(scenario=scenario))


def test_stretches_that_cannot_be_are_refused(subtests) -> None:
    for scoring in [{"min_stretches": 12}, {"all_stretches": 13}, {"stretches": 2}]:
        with subtests.test(scoring=scoring), pytest.raises(TaskError):
            load_task(_changed(scoring=scoring))


def _changed(**parts: Any) -> str:
    document = dict(TASK.as_document()) | {"name": "stricter"}
    for part, changes in parts.items():
        document[part] = {**document[part], **changes}
    return json.dumps({key: value for key, value in document.items() if value is not None}) + "\n"
