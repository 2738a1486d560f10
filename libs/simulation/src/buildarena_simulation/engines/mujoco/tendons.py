"""MuJoCo's tendons, the ropes and springs that hold, and its welds, what blocks hold."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from buildarena_simulation.structure.grips import Hold
from buildarena_simulation.structure.model import FloatArray, Ropes


@dataclass(frozen=True, slots=True, kw_only=True)
class Tendons:
    """Ropes and springs of a compiled model.

    Attributes:
        ropes: All ropes and springs of the machine.
        of: Tendon of each one that holds.
    """

    model: "mujoco.MjModel"
    data: "mujoco.MjData"
    ropes: Ropes
    of: Mapping[int, int]

    def drop(self, index: int) -> None:
        """Remove a rope or spring."""
        tendon, model = self.of[index], self.model
        model.tendon_limited[tendon] = 0
        model.tendon_stiffness[tendon] = model.tendon_damping[tendon] = 0.0

    def set_lengths(self, lengths: FloatArray) -> None:
        """Set the springs' lengths at rest, (R,), units."""
        for rope in self.ropes.springs:
            if int(rope) in self.of:
                self.model.tendon_lengthspring[self.of[int(rope)]] = lengths[rope]

    def tensions(self) -> FloatArray:
        """Return the pull of each rope and spring in the last step, (R,), mass·unit/s²."""
        tensions, data = np.zeros(len(self.ropes)), self.data
        if not self.of:
            return tensions
        limits = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON
        force_of = {int(data.efc_id[k]): data.efc_force[k] for k in np.flatnonzero(limits)}
        for rope, tendon in self.of.items():
            tensions[rope] = force_of.get(tendon, 0.0)
            if self.ropes.stiffness[rope]:
                tensions[rope] = self._pull(tendon)
        return tensions

    def _pull(self, tendon: int) -> float:
        model, data = self.model, self.data
        stretch = data.ten_length[tendon] - model.tendon_lengthspring[tendon, 0]
        pull = model.tendon_stiffness[tendon] * stretch
        return float(pull + model.tendon_damping[tendon] * data.ten_velocity[tendon])


def weld_wrenches(
    model: "mujoco.MjModel", data: "mujoco.MjData", holds: Sequence[Hold]
) -> FloatArray:
    """Return force and moment on each block that holds, about its hold's point, (H, 6), world.

    A weld's six constraint forces act on its first body: a force, and twice a moment in the axes of
    the second body.
    """
    wrenches = np.zeros((len(holds), 6))
    if not holds:
        return wrenches
    equalities = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    for row, hold in enumerate(holds):
        weld = model.equality(f"grip {hold.grip}").id
        rows = np.flatnonzero(equalities & (data.efc_id[: data.nefc] == weld))
        if len(rows) == len(wrenches[row]):
            force = data.efc_force[rows]
            turn = data.xmat[model.eq_obj2id[weld]].reshape(3, 3)
            wrenches[row] = -np.concatenate([force[:3], turn @ force[3:] / 2])
    return wrenches


def hold_as_they_are(model: "mujoco.MjModel", data: "mujoco.MjData", holds: Sequence[Hold]) -> None:
    """Set welds to the bodies' present poses instead of the compiled ones.

    A body on a joint is compiled as it was built, and the cargo where it started.
    """
    if not holds:
        return
    mujoco.mj_kinematics(model, data)
    for hold in holds:
        weld = model.equality(f"grip {hold.grip}").id
        held, own = int(model.eq_obj1id[weld]), int(model.eq_obj2id[weld])
        point = data.xpos[own] + data.xmat[own].reshape(3, 3) @ model.eq_data[weld, :3]
        back, turn = np.zeros(4), np.zeros(4)
        mujoco.mju_negQuat(back, data.xquat[held])
        mujoco.mju_mulQuat(turn, back, data.xquat[own])
        model.eq_data[weld, 3:6] = data.xmat[held].reshape(3, 3).T @ (point - data.xpos[held])
        model.eq_data[weld, 6:10] = turn
