"""What engines take: own modules, balls, many parts; and what cannot be simulated."""

import itertools
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from support.machines.building import BLOCK, KeyedDraft, built
from support.machines.families import beam
from support.machines.module_files import BASIC, like, module_file
from support.programs import captured

from buildarena_benchmark import score
from buildarena_benchmark.experts.drafting import EAST, UP
from buildarena_geometry import Catalogue, Machine, load_catalogue
from buildarena_simulation import MachineNotSimulable, Scenario, rollout, simulate
from buildarena_simulation.constants import MAX_PARTS
from buildarena_simulation.control import heated_cannons, recoil
from buildarena_simulation.engines.base import Engine, World, rotation_of
from buildarena_simulation.engines.mujoco import engine as mujoco_engine
from buildarena_simulation.engines.registry import create_engine
from buildarena_simulation.machine import structure_of
from buildarena_simulation.scenario import Control, ReleasedPlacement
from buildarena_simulation.structure.motion import Motion


def test_a_trial_with_invalid_numbers_is_recorded_to_its_end_and_fails(
    engine, tasks, monkeypatch
) -> None:
    def fragile(name: str, world: World) -> Engine:
        made = create_engine(name, world)
        motion, calls = made.motion, itertools.count()

        def lost() -> Motion:
            now = motion()
            return replace(now, position=now.position + (np.nan if next(calls) > 10 else 0.0))

        monkeypatch.setattr(made, "motion", lost)
        return made

    monkeypatch.setattr(rollout, "create_engine", fragile)
    scenario = tasks["lift-1"].scenario.model_copy(update={"duration_s": 2.0})
    positions = (trajectory := simulate(beam(3), scenario, engine)).positions
    assert np.isfinite(positions[:5]).all()
    assert not np.isfinite(positions[-1]).any()
    result = score(tasks["lift-1"], beam(3), trajectory)
    assert (result.success, result.flags) == (False, ("unstable",))


def test_a_machine_of_ten_thousand_blocks_is_refused_at_once(engine, tasks) -> None:
    draft = KeyedDraft()
    draft.start()

    # Building one block by block would take long: this one only says that it is large.
    crowd = SimpleNamespace(blocks=draft.machine.blocks, part_count=10_000)
    with pytest.raises(MachineNotSimulable, match=str(MAX_PARTS)):
        simulate(crowd, tasks["lift-1"].scenario, engine)


def test_a_scenario_that_tracks_a_missing_block_says_so(tasks) -> None:
    scenario = tasks["lift-1"].scenario.model_copy(update={"tracked_blocks": ("1", "77")})
    with pytest.raises(MachineNotSimulable, match="77"):
        simulate(beam(3), scenario, "mujoco")


def _other(name: str, **fields: Any) -> dict[str, Any]:
    return like(name, "Other", **fields)


def _catalogue(folder: Path, module: dict[str, Any]) -> Catalogue:
    return load_catalogue(module_file(folder, module))


def test_a_cannon_pushes_and_is_heated_as_its_entry_says(tmp_path) -> None:
    heated = {"cold": 2.0, "heated": 20.0, "spheres": [{"along": 3.0, "radius": 0.5}]}
    thrust = BASIC["Water Cannon"]["thrust"] | {"along": -0.5} | heated
    catalogue = _catalogue(tmp_path, _other("Water Cannon", thrust=thrust))
    structure = structure_of(built(("1", "A", "Other"), ("1", "B", "Torch"), catalogue=catalogue))
    (cannon,), (torch,) = structure.cannons, structure.torches
    expected = structure.shown[cannon] - 0.5 * structure.directions[cannon]
    assert structure.thrust_points[0] == pytest.approx(expected)
    shown, ways = np.zeros((len(structure), 3)), np.zeros((len(structure), 3))
    ways[[cannon, torch]] = (0, 0, -1)
    for height, hot in ((-2, True), (0, False)):
        shown[torch] = (0, 0, height)
        assert heated_cannons(structure, shown, ways)[0] == hot
    cold, hot = (recoil(structure, np.array([True]), np.array([heat]))[0] for heat in (False, True))
    assert hot / cold == pytest.approx(10)


RADIUS = 0.8


@pytest.fixture
def on_a_ball(tmp_path: Path) -> Machine:
    """A starting block on top of a ball that hangs from its lower face."""
    ball = like(BLOCK, "Ball", faces=[], mass=2.0, grabs=False)
    ball["body"] = [{"shape": "sphere", "radius": RADIUS, "center": [0, 0, 0.9]}]
    ball["physics"]["mass_at"] = "body"
    catalogue = load_catalogue(module_file(tmp_path, ball))
    return built(("1", "D", "Ball"), catalogue=catalogue, init_rotation=[0, 0, 40])


def test_a_ball_has_a_balls_volume_and_inertia(on_a_ball) -> None:
    structure = structure_of(on_a_ball)
    shape = structure.parts[1].shapes[0]
    assert shape.volume == pytest.approx(4 / 3 * np.pi * RADIUS**3)
    np.testing.assert_allclose(shape.reach(), RADIUS)
    np.testing.assert_allclose(
        structure.inertias[1], 2 / 5 * 2.0 * RADIUS**2 * np.eye(3), atol=1e-12
    )


def test_a_ball_touches_the_ground_at_its_radius(on_a_ball, engine) -> None:
    # Tilted by 40°, a box of the same extent would stand a third higher, or be pushed up there.
    trajectory = simulate(on_a_ball, Scenario(duration_s=0.2), engine=engine, seed=0)
    away = rotation_of(trajectory.quaternions[-1, 1].astype(float))[:, 2]
    middle = trajectory.positions[-1, 1] + 0.4 * away
    assert middle[2] == pytest.approx(RADIUS, abs=0.03)


HEAVY = ("pybullet", "mujoco", "pyarrow", "scipy", "matplotlib", "PIL")


def printed(program: str) -> str:
    """What a program prints in a process of its own, which must have no other words."""
    run = [sys.executable, "-c", program]
    done = captured(run)
    assert done.stderr == ""
    return done.stdout.strip()


def test_importing_a_library_loads_nothing_heavy() -> None:
    program = "import sys, buildarena_simulation, buildarena_benchmark\n"
    assert not printed(program + f"print(*sorted(set({HEAVY!r}) & set(sys.modules)))")


def test_an_engine_keeps_stdout_and_stderr_clean() -> None:
    program = (
        "from buildarena_simulation import Scenario, simulate\n"
        "from buildarena_geometry import Machine\n"
        "m = Machine(); m.act('start', {})\n"
        "for engine in ('pybullet', 'mujoco'):\n"
        "    simulate(m, Scenario(duration_s=0.2), engine)\n"
        "print('done')"
    )
    assert printed(program) == "done"


PIECES = 12


SPARSE_FROM = 60
"""Degrees of freedom from which MuJoCo chooses sparse Jacobians by itself."""


def test_a_heap_of_jointed_pieces_is_solved_with_dense_jacobians(monkeypatch) -> None:
    """MuJoCo 4.0.0 factorises sparse ones wrongly: such worlds had accelerations 99 % off."""
    draft = KeyedDraft()
    row = draft.row(draft.start(), EAST, 2 * PIECES)
    for block in row[1::2]:
        draft.attach(block, UP, "Powered Wheel")
    for block in row[::2]:
        draft.do("remove_block", block_id=block)
    worlds: list[str] = []
    written = mujoco_engine.mjcf_of

    def mjcf_of(*given) -> str:
        worlds.append(written(*given))
        return worlds[-1]

    monkeypatch.setattr(mujoco_engine, "mjcf_of", mjcf_of)
    placement = ReleasedPlacement(height=6.0, velocity=(0.0, 0.0, 0.0))
    scenario = Scenario(duration_s=2.0, placement=placement, control=Control(mode="agent"))
    trajectory = simulate(draft.machine, scenario, "mujoco")
    for text in worlds:
        model = mujoco.MjModel.from_xml_string(text)
        assert model.nv > SPARSE_FROM
        assert not mujoco.mj_isSparse(model)
    heights = trajectory.positions[-10:, :, 2]
    assert np.isfinite(heights).all()
    assert np.ptp(heights, axis=0).max() < 0.01, "what has fallen lies still"
    assert heights.min() > 0.0
