"""Worlds of many degrees of freedom: MuJoCo solves them as it solves small ones."""

import mujoco
import numpy as np
from support.machines.drafts import KeyedDraft

from buildarena_simulation import Scenario, simulate
from buildarena_simulation.engines.mujoco import engine as mujoco_engine
from buildarena_simulation.scenario import Control, ReleasedPlacement
from buildarena_worker.builtin.designs.drafting import EAST, UP

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
