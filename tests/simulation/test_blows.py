"""A blow breaks something only if finer steps show it as well."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.machines.families import beam, car, deck
from support.machines.people.bridges import arch

from buildarena_benchmark import builtin_tasks
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory, rollout, simulate
from buildarena_simulation.scenario import Control, ReleasedPlacement
from buildarena_simulation.structure.contacts import ContactForces

INTERVAL_S = 0.04
STANDING = Scenario(duration_s=1.0, control=Control(mode="agent"))
OVER_A_GAP = builtin_tasks()["support-1"].scenario.model_copy(update={"duration_s": 1.0})
CASES = {
    "beam": (beam(5), STANDING),
    "deck": (deck(3, 5), STANDING),
    "car": (car(), STANDING),
    "arch": (arch(5, rise=2, step=1), OVER_A_GAP),
}
ENOUGH = 1e6
"""A push that breaks any of them, mass·unit/s²."""


class _Liar:
    """An engine that reports blows which are not there.

    Args:
        engine: The true engine.
        pushes: By the number of an interval, from 0, what it adds upwards to a contact in it at the
            usual step and in finer ones, mass·unit/s².
    """

    def __init__(self, engine: Any, pushes: dict[int, tuple[float, float]]) -> None:
        self._engine, self._pushes = engine, pushes
        self._number, self._finer = -1, 1
        self.repeated: list[int] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._engine, name)

    @property
    def struck(self) -> bool:
        """Whether something hit the machine, or is said to have."""
        return self._push > 0.0 or bool(self._engine.struck)

    def enter(self, *arguments: Any, finer: int = 1, **places: Any) -> None:
        """See `Engine`."""
        self._finer = finer
        self._engine.enter(*arguments, finer=finer, **places)

    def advance(self, *arguments: Any) -> None:
        """See `Engine`."""
        if self._finer == 1:
            self._number += 1
        else:
            self.repeated.append(self._number)
        self._engine.advance(*arguments)

    def contacts(self) -> ContactForces:
        """See `Engine`."""
        true = self._engine.contacts()
        added = np.zeros_like(true.force)
        added[:1, 2] = self._push
        return replace(true, force=true.force + added)

    @property
    def _push(self) -> float:
        return self._pushes.get(self._number, (0.0, 0.0))[self._finer > 1]


@pytest.fixture
def tried(engine: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Tries a case with an engine that lies."""
    create = rollout.create_engine

    def simulated(
        name: str, pushes: dict[int, tuple[float, float]]
    ) -> tuple[Trajectory, list[int]]:
        liars: list[_Liar] = []

        def lying(*arguments: Any) -> Any:
            liars.append(_Liar(create(*arguments), pushes))
            return liars[-1]

        monkeypatch.setattr(rollout, "create_engine", lying)
        trajectory = simulate(*CASES[name], engine)
        monkeypatch.setattr(rollout, "create_engine", create)
        return trajectory, liars[0].repeated

    return simulated


@pytest.mark.nightly(keep=9)
@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("at", [(12,), (13,), (12, 20)])
def test_a_blow_that_finer_steps_do_not_show_breaks_nothing(engine, tried, name, at) -> None:
    trajectory, repeated = tried(name, dict.fromkeys(at, (ENOUGH, 0.0)))
    assert repeated == list(at)
    assert not trajectory.breaks
    assert trajectory.joint_loads.max() < 1.0
    still = simulate(*CASES[name], engine)
    assert trajectory.positions[-1] == pytest.approx(still.positions[-1], abs=0.02)


@pytest.mark.parametrize("name", ["beam", "arch"])
def test_a_blow_counts_as_finer_steps_show_it(tried, name) -> None:
    """A peak far above the strength at the usual step, and a quarter of it in finer ones."""
    whole = tried(name, {12: (ENOUGH, ENOUGH)})[0].joint_loads[13].max()
    push = 2.4 * ENOUGH / whole
    trajectory, repeated = tried(name, {12: (push, 0.25 / 2.4 * push)})
    assert repeated == [12]
    assert not trajectory.breaks
    assert 0.1 < trajectory.joint_loads[12:15].max() < 0.6


@pytest.mark.parametrize("name", ["beam", "deck", "arch"])
def test_a_blow_that_finer_steps_show_breaks(tried, name) -> None:
    trajectory, repeated = tried(name, {12: (ENOUGH, ENOUGH)})
    assert repeated[0] == 12
    assert trajectory.breaks[0].time_s == pytest.approx(13 * INTERVAL_S)


@pytest.mark.parametrize(("length", "speed"), [(21, 100.0), (25, 90.0)])
def test_a_machine_that_hits_the_ground_hard_breaks(engine, length, speed) -> None:
    trajectory = _thrown(car(length, 3), speed, engine)
    assert trajectory.breaks[0].time_s == pytest.approx(0.12, abs=0.05)


@pytest.mark.parametrize("length", [15, 21])
def test_what_is_repeated_gives_the_same_bytes(engine, length) -> None:
    first, second = (_thrown(car(length, 3), 100.0, engine) for _ in range(2))
    assert first.positions.tobytes() == second.positions.tobytes()
    assert first.joint_loads.tobytes() == second.joint_loads.tobytes()
    assert first.breaks == second.breaks


def _thrown(machine: Machine, speed: float, engine: str) -> Trajectory:
    thrown = ReleasedPlacement(height=10.0, velocity=(0.0, 0.0, -speed))
    return simulate(machine, Scenario(duration_s=1.0, placement=thrown), engine)
