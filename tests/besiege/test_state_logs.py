"""The headless game's output becomes a trajectory with the turns it tells."""

import math

import pytest
from tests.besiege.playing import vehicle

from buildarena_besiege import LogIncompleteError, StateLog
from buildarena_geometry.besiege_components import besiege_rotation
from buildarena_simulation import Scenario

MACHINE = vehicle()
SCENARIO = Scenario(duration_s=2.0)
HEAD = "[Info   :BesiegeAgent] SendMessage: "


def stat(k: int, turn: float = 0.0) -> str:
    parts = []
    for i, block in enumerate(MACHINE.blocks.values()):
        w, x, y, z = besiege_rotation(block)
        assert turn == 0.0 or i == 0
        parts.append(f"Block{i}{'_broken' * (i == 3)}:{i}.5,{k},{-i},{x},{y},{z},{w},0.1")
    return f"{HEAD}GameStat:{'|'.join([*parts, 'GOAL_1:0,0,0,0,0,0,1,0'])}|"


def output(count: int = 11) -> str:
    lines = [
        "[Info   : Unity] loading",
        f"{HEAD}MachineLoaded",
        stat(99),
        f"{HEAD}SimulationStart",
        *(stat(k) for k in range(count)),
        f"{HEAD}SimulationEnd",
        stat(77),
    ]
    return "\n".join(lines) + "\n"


def read(text: str) -> StateLog:
    log = StateLog("r")
    log.read(text)
    return log


def test_positions_and_turns_are_told() -> None:
    log = read(output())
    assert (log.begun, log.ended, log.time_s) == (True, True, 2.0)
    found = log.trajectory(MACHINE, SCENARIO, game="1.60", mod="bf")
    assert found.block_ids == ("1", "2", "3", "4")
    assert found.positions.shape == (51, 4, 3)
    assert found.positions[25, 2] == pytest.approx([2.5, -2.0, 5.0], abs=1e-3)
    for k, block in enumerate(MACHINE.blocks.values()):
        cosine = float(found.quaternions[9, k] @ block.world_from_block.quaternion)
        assert abs(cosine) == pytest.approx(1.0, abs=1e-5)
    assert found.settings["quaternions"] == "the log"


@pytest.mark.parametrize("size", [1, 7, 100])
def test_a_stream_may_be_cut_anywhere(size) -> None:
    text = output().replace("\n", "\r\n")
    log = StateLog("r")
    for at in range(0, len(text), size):
        log.read(text[at : at + size])
    assert log == read(output())
    again = read(log.text())
    assert (again == log, again.time_s) == (True, 2.0)


def test_errors_are_complaints() -> None:
    log = read("NullReferenceException: Object\n[Error :  Unity] x\nfine\n" + output())
    assert log.complaints == ("NullReferenceException: Object", "[Error :  Unity] x")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "does not tell of a simulation's start"),
        (output(5), r"ends after 0\.8 s of 2 s"),
        (output().replace("GOAL_1", "Other"), "tells of 5 blocks; the machine file has 4"),
    ],
)
def test_what_is_missing_is_said(text, says) -> None:
    with pytest.raises(LogIncompleteError, match=says):
        read(text).trajectory(MACHINE, SCENARIO, game="1", mod="2")


@pytest.mark.parametrize("part", ["x:1,2,3", "x:1,2,3,4,5,6,7,nan", "x", "x:a,b,c,d,e,f,g,h", ""])
def test_damaged_lines_do_not_count(part) -> None:
    text = output().replace(stat(4) + "\n", f"{stat(4)}\n{HEAD}GameStat:{part}|\n")
    assert read(text).text() == read(output()).text()


def test_half_turns_without_length_are_no_turn() -> None:
    text = output()
    w, x, y, z = besiege_rotation(MACHINE.blocks["1"])
    text = text.replace(f"{x},{y},{z},{w},0.1", "0,0,0,0,0.1")
    found = read(text).trajectory(MACHINE, SCENARIO, game="1", mod="2")
    assert all(math.isfinite(value) for value in found.quaternions[0, 0])
