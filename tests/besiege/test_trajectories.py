"""Logs become trajectories in our world frame; what is missing is said."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.game.game_rig import experts_machine
from support.machines.building import attach
from tests.besiege.playing import RUN, log_of, played, press, vehicle

from buildarena_benchmark import builtin_tasks, score
from buildarena_besiege import GameLog, LogIncompleteError, game_start, trajectory_of
from buildarena_besiege.logs.trajectories import Samples, build_trajectory
from buildarena_besiege.run import prepared_machine
from buildarena_simulation import Scenario, simulate

TASKS = builtin_tasks()
MACHINE = vehicle(cannon=True)
SHORT = Scenario(duration_s=2.0)


def still(i: int, n: int) -> tuple[float, float, float]:
    return (float(i), 5.0 + 0.01 * n, -2.0 * i)


def trajectory(game, machine=MACHINE, scenario=SHORT):
    return trajectory_of(log_of(game), machine, scenario, game="1.75", mod="2")


def without(game, gone) -> GameLog:
    """The log without the samples of some updates."""
    log = GameLog(RUN)
    log.read("\n".join(x for x in game.lines if ",s," not in x or int(x.split(",")[3]) not in gone))
    return log


BLOCKS = MACHINE.blocks.values()
FROM_ROOTS = [np.array(b.center_xyz) - np.array(b.world_from_block.xyz) for b in BLOCKS]
"""The game tells roots, and trajectories hold centres."""


def test_positions_are_east_north_up_at_25_hz() -> None:
    found = trajectory(played(MACHINE, SHORT, path=still))
    assert found.block_ids == ("1", "2", "3", "4", "5")
    assert found.time_s.tolist() == [k / 25 for k in range(51)]
    expected = np.array(
        [[[i, -2.0 * i, 5.0 + 0.04 * max(k, 1)] for i in range(5)] for k in range(51)]
    ) + np.array(FROM_ROOTS)
    assert np.abs(found.positions - expected).max() < 2e-4
    assert (found.engine, found.engine_version) == ("besiege", "1.75-2")
    assert (found.bearing, found.breaks, found.joint_peaks) == (None, (), ())
    assert found.cargo_position is None


def test_blocks_that_do_not_move_as_one_keep_their_turns() -> None:
    found = trajectory(played(MACHINE, SHORT, path=still))
    placed = [block.world_from_block.wxyz for block in MACHINE.blocks.values()]
    assert np.abs(found.quaternions - np.array(placed)).max() < 1e-5
    assert found.settings["quaternions"] == "as placed"


def test_the_cargo_has_place_and_mass() -> None:
    scenario = TASKS["transport-2"].scenario.model_copy(update={"duration_s": 4.0})
    found = trajectory(played(MACHINE, scenario, path=still), scenario=scenario)
    assert found.block_ids == ("1", "2", "3")
    cargo = len(MACHINE.blocks)  # it comes last in the file
    assert found.cargo_position[25] == pytest.approx([cargo, -2.0 * cargo, 6.75], abs=1e-3)
    wanted = [scenario.cargo.mass_at(k / 25) for k in range(1, 101)]
    assert found.cargo_mass[1:] == pytest.approx(wanted, abs=1e-4)
    assert found.cargo_size == scenario.cargo.size
    assert found.settings["cannons_not_reported"] == 1


def test_cannons_that_burn_are_heated() -> None:
    found = trajectory(played(MACHINE, SHORT, path=still, burning=lambda _, n: n >= 100))
    assert found.cannon_ids == ("5",)
    assert found.heated[:, 0].tolist() == [k >= 25 for k in range(51)]


def test_a_block_that_went_away_is_a_piece_of_its_own() -> None:
    def path(i, n):
        x, y, z = still(i, n)
        away = 5.0 if i == 3 and 80 <= n < 120 else 0.9 if i == 2 else 0.0
        return (x + away * min(n / 80, 1.0), y, z)

    found = trajectory(played(MACHINE, SHORT, path=path))
    assert (found.pieces[:20] == 0).all()
    assert found.pieces[50].tolist() == [0, 0, 0, 3, 0], "what broke off stays off"


def test_short_gaps_are_filled_in_a_straight_line(subtests) -> None:
    for gone in [{100}, {100, 104, 108, 112}, {4, 8, 12}, {192, 196, 200}]:
        with subtests.test(gone=gone):
            game = played(MACHINE, SHORT, path=still)
            found = trajectory_of(without(game, gone), MACHINE, SHORT, game="1", mod="2")
            whole = trajectory(game)
            inside = slice(5, 46)
            assert np.abs(found.positions[inside] - whole.positions[inside]).max() < 1e-3
            assert found.settings["filled_samples"] == len(gone)
            missing = len(gone) + (100 in gone or 4 in gone)
            assert found.settings["longest_gap_s"] == pytest.approx(0.04 * missing)


def test_what_is_missing_at_the_end_goes_on_as_it_went() -> None:
    def rising(i, n):
        x, y, z = still(i, n)
        return (x, y + 150.0 * n / 100, z)

    game = played(MACHINE, SHORT, path=rising)
    found = trajectory_of(without(game, {192, 196, 200}), MACHINE, SHORT, game="1", mod="2")
    whole = trajectory(game)
    assert whole.positions[-1, 0, 2] - whole.positions[-4, 0, 2] > 10
    assert np.abs(found.positions - whole.positions).max() < 1e-2
    assert (found.pieces == whole.pieces).all()


def test_long_gaps_are_named(subtests) -> None:
    for gone, says in [
        (range(100, 121, 4), r"Between 0\.96 s and 1\.24 s nothing is reported of block 1"),
        (range(4, 29, 4), r"Between 0\.00 s and 0\.32 s"),
        (range(176, 201, 4), r"Between 1\.72 s and 2\.00 s"),
        (range(4, 201, 4), "contains nothing on block 1"),
    ]:
        with subtests.test(gone=gone):
            game = played(MACHINE, SHORT, path=still)
            with pytest.raises(LogIncompleteError, match=says):
                trajectory_of(without(game, set(gone)), MACHINE, SHORT, game="1", mod="2")


def test_a_log_without_begin_or_end_is_incomplete() -> None:
    lines = played(MACHINE, SHORT, path=still).lines
    log = GameLog(RUN)
    with pytest.raises(LogIncompleteError, match="begin line of run run-1 is missing"):
        trajectory_of(log, MACHINE, SHORT, game="1", mod="2")
    log.read("\n".join(line for line in lines if ",e," not in line))
    with pytest.raises(LogIncompleteError, match=r"ends at 2\.00 s of 2 s"):
        trajectory_of(log, MACHINE, SHORT, game="1", mod="2")


def test_a_log_of_something_else_is_refused() -> None:
    log = log_of(played(MACHINE, SHORT, path=still))
    for machine, scenario in (
        (vehicle(), SHORT),
        (MACHINE, SHORT.model_copy(update={"duration_s": 1.0})),
        (MACHINE, TASKS["lift-1"].scenario),
    ):
        with pytest.raises(LogIncompleteError, match="another machine or another scenario"):
            trajectory_of(log, machine, scenario, game="1", mod="2")


def drive(i: int, n: int) -> tuple[float, float, float]:
    return (float(i), 1.0, max(n - 300, 0) * 0.01)


def test_our_scorers_take_it(subtests) -> None:
    for task in ["transport-1", "lift-1", "lift-2"]:
        with subtests.test(task=task):
            chosen = TASKS[task]
            controls = [press(1.0, "UpArrow", 20)]
            game = played(MACHINE, chosen.scenario, controls=controls, path=drive)
            found = trajectory(game, scenario=chosen.scenario)
            result = score(chosen, MACHINE, found)
            if task == "transport-1":
                assert result.indicator == pytest.approx(27.0, abs=0.01)
                assert "drive_not_measured" in result.flags
                assert found.settings["effective_key_presses"] == 1


def fall(i: int, n: int) -> tuple[float, float, float]:
    """The cargo's root sinks from 8 on; its centre is 0.75 higher."""
    return (0.0, 8.0 - (max(n - 1000, 0) * 0.01), 0.0) if i == 5 else (float(i), 6.0, 0.0)


def test_the_load_of_a_bridge_is_the_cargos_mass_when_it_falls() -> None:
    chosen = TASKS["support-2"]
    found = trajectory(played(MACHINE, chosen.scenario, path=fall), scenario=chosen.scenario)
    result = score(chosen, MACHINE, found)
    assert result.success
    assert result.indicator == pytest.approx(chosen.scenario.cargo.mass_at(14.76), abs=0.1)
    assert "span_not_measured" in result.flags


def test_centres_and_turns_are_told_by_the_roots_of_what_moves_as_one() -> None:
    machine = experts_machine("lift-2")
    for base, face in (("1", "C"), ("12", "A")):  # a weight aside: it turns on its way
        assert attach(machine, base, face, "Small Wooden Block", note="").ok
    scenario = TASKS["lift-2"].scenario.model_copy(update={"duration_s": 8.0})
    true = simulate(machine, scenario, "mujoco")
    ids = true.block_ids
    centers = np.array([machine.blocks[one].module.center for one in ids])
    turns = Rotation.from_quat(true.quaternions.reshape(-1, 4)[:, [1, 2, 3, 0]])
    offsets = turns.apply(np.tile(centers, (len(true.time_s), 1))).reshape(true.positions.shape)
    roots = (true.positions - offsets)[:, :, [0, 2, 1]].astype(float)
    samples = Samples(block_ids=ids, positions=roots, burning=np.zeros(roots.shape[:2], bool))
    found = build_trajectory(samples, machine, scenario, version="1-1")
    assert found.settings["quaternions"] == "fitted to the blocks' places"
    assert found.positions[:, 0, 2].max() > 100
    assert np.abs(found.positions - true.positions).max() < 1e-3
    assert np.abs((found.quaternions * true.quaternions).sum(axis=2)).min() > 1 - 1e-4
    assert np.ptp(true.quaternions[:, 0], axis=0).max() > 0.05, "it turns"


ROOTS = [record.position for record in prepared_machine(MACHINE, SHORT, run_id=RUN).records]


def begun(i: int, n: int) -> tuple[float, float, float]:
    """Where blocks are that stand where the game puts them, and drift slowly."""
    x, y, z = ROOTS[i] + game_start(MACHINE, SHORT).position[[0, 2, 1]]
    return (float(x) + 0.01 * n / 4, float(y), float(z))


@pytest.mark.ci
def test_a_late_start_counts_where_the_first_sample_is_near_the_trials_begin(
    subtests,
) -> None:
    for late in [0.24, 0.32, 0.4]:
        with subtests.test(late=late):
            gone = set(range(4, round(late * 100), 4))
            log = without(played(MACHINE, SHORT, path=begun), gone)
            found = trajectory_of(log, MACHINE, SHORT, game="1", mod="2")
            assert found.settings["longest_gap_s"] == pytest.approx(late)

            def elsewhere(i: int, n: int) -> tuple[float, float, float]:
                x, y, z = begun(i, n)
                return (x + 4.0, y, z)

            log = without(played(MACHINE, SHORT, path=elsewhere), gone)
            with pytest.raises(LogIncompleteError, match=r"Between 0\.00 s"):
                trajectory_of(log, MACHINE, SHORT, game="1", mod="2")


def test_a_cargo_that_the_game_destroyed_is_no_trial() -> None:
    scenario = TASKS["transport-2"].scenario.model_copy(update={"duration_s": 2.0})
    cargo = len(MACHINE.blocks)
    game = played(MACHINE, scenario, path=still, destroyed=lambda i, n: i == cargo and n > 150)
    with pytest.raises(LogIncompleteError, match=r"destroyed the cargo at 1\.52 s"):
        trajectory(game, scenario=scenario)
