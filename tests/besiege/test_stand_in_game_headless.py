"""The stand-in game without a window: the published protocol over TCP and standard output."""

from __future__ import annotations

import json
import queue
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from stand_in_machines import machine_file
from stand_in_play import SUPPORT, start_game

from buildarena_geometry import Machine

HEAD = "[Info   :BesiegeAgent] "
WAIT_S = 30.0
LEVEL = """<Level><Objects><Object ID="1" Prefab="7000"><Position x="0" y="0" z="0" />
<Scale x="30" y="3" z="30" /></Object></Objects></Level>"""


class Player:
    """One headless game and the connection to it."""

    def __init__(self, *options: str) -> None:
        self.process = start_game(
            *("--headless", "--port", "0", "--speed", "20", "--horizon", "3", *options),
            *("-batchmode", "-nographics", "-offline", "--trainmode", "false"),
            environment={},
        )
        self.lines: list[str] = []
        self._told: queue.Queue[str] = queue.Queue()
        self._reader = threading.Thread(target=self._read)
        self._reader.start()
        port = self.until("TCP listening on port").split()[-1]
        self.until("TCP initalized")
        self.socket = socket.create_connection(("127.0.0.1", int(port)))

    def until(self, words: str) -> str:
        """The next line with these words; what came before is kept in `lines`."""
        end = time.monotonic() + WAIT_S
        while True:
            try:
                line = self._told.get(timeout=max(0.0, end - time.monotonic()))
            except queue.Empty:
                pytest.fail(f"waited in vain for {words!r} after {self.lines[-3:]}")
            assert line.startswith(HEAD)
            self.lines.append(line.removeprefix(HEAD).rstrip("\n"))
            if words in line:
                return self.lines[-1]

    def quiet_for(self, seconds: float) -> bool:
        """Whether nothing is told for so long."""
        try:
            self._told.get(timeout=seconds)
        except queue.Empty:
            return True
        return False

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._told.put(line)

    def send(self, text: str) -> None:
        data = text.encode()
        self.socket.sendall(struct.pack("<I", len(data)) + data)

    def states(self) -> list[list[tuple[str, list[float]]]]:
        """The states told so far: per block its name and its figures."""
        head = "SendMessage: GameStat:"
        found = []
        for line in self.lines:
            if line.startswith(head):
                entries = [
                    entry.split(":") for entry in line.removeprefix(head).split("|") if entry
                ]
                found.append(
                    [(name, [float(v) for v in text.split(",")]) for name, text in entries]
                )
        return found

    def run(self, path: Path, states: int) -> None:
        self.send(f"2 {path}")
        self.until("SendMessage: MachineLoaded")
        self.send("3 _")
        self.until("SendMessage: SimulationStart")
        for _ in range(states):
            self.until("GameStat")

    def close(self) -> None:
        self.socket.close()
        self.process.kill()
        self.process.wait()
        self._reader.join()
        assert self.process.stdout is not None
        self.process.stdout.close()


@pytest.fixture
def player() -> Iterator[Player]:
    player = Player()
    yield player
    player.close()


@pytest.fixture
def slow_player() -> Iterator[Player]:
    """At the wall clock's pace, so that a key comes when it should on a busy machine, too."""
    player = Player("--speed", "1")
    yield player
    player.close()


def post(*, key: str = "Alpha1") -> Machine:
    machine = Machine()
    machine.act("start", {})
    machine.act("attach_block_to", {"base_block": "1", "face": "E", "new_block": "Water Cannon"})
    bind = {"block_id": "2", "action": "hold_to_fire", "new_key": key}
    assert machine.act("change_control_key", bind).ok
    return machine


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "post.bsg"
    path.write_text(machine_file(post(), position=(0.0, 9.0, 0.0)))
    return path


def test_a_run_tells_states_five_times_a_second(player: Player, path: Path) -> None:
    player.run(path, 6)
    player.send("3 _")
    player.until("SendMessage: SimulationEnd")
    assert player.lines[0] == "SendMessage: GameLaunched"
    states = player.states()
    assert [name for name, _ in states[0]] == ["StartingBlock", "WaterCannon"]
    first = states[0][0][1]
    assert first == pytest.approx([0, 9, 0, 0, 0, 0, 1, 0], abs=1e-3)
    fallen = 9 - 0.5 * 32.81 * 0.2**2
    assert states[1][0][1][1] == pytest.approx(fallen, abs=0.15)
    assert states[5][0][1][1] < states[2][0][1][1]


def test_a_key_works_from_when_it_comes(slow_player: Player, path: Path) -> None:
    """The cannon to the north of the block points down, so that its push is upwards."""
    player = slow_player
    player.run(path, 4)
    player.send("3 _")
    player.until("SimulationEnd")
    falling = player.states()
    player.lines.clear()
    player.run(path, 1)
    player.send("4 Alpha1_T")
    player.until("SendMessage: PressKey")
    for _ in range(4):
        player.until("GameStat")
    pushed = player.states()
    assert pushed[0] == falling[0]
    assert pushed[3][1][1][1] > falling[3][1][1][1] + 0.3
    player.send("3 _")
    player.until("SimulationEnd")
    player.lines.clear()
    player.run(path, 4)
    assert player.states()[3] == falling[3]  # the key of one run is not the next one's


def test_a_forced_fail_ends_the_run_and_another_may_begin(player: Player, path: Path) -> None:
    player.run(path, 1)
    player.send("6 _")
    player.until("SendMessage: LevelFail")
    player.until("SendMessage: SimulationEnd")
    before = len(player.states())
    player.send("3 _")
    player.until("SendMessage: SimulationStart")
    player.until("GameStat")
    assert player.states()[before] == player.states()[0]


def test_a_level_gives_the_machine_something_to_land_on(
    player: Player, path: Path, tmp_path: Path
) -> None:
    level = tmp_path / "box.blv"
    level.write_text(LEVEL)
    player.send("0 3")
    player.until("SendMessage: BuildingSceneLoaded")
    player.send(f"5 {level}")
    player.until("SendMessage: CustomLevelLoaded")
    player.run(path, 12)
    assert player.states()[-1][0][1][1] > 3.3


@pytest.mark.parametrize(
    ("command", "complaint"),
    [
        ("2 /nowhere/post.bsg", "could not load post"),
        ("3 _", "no machine to simulate"),
        ("4 Alpha1", "a key is <name>_T or <name>_F"),
        ("5 /nowhere.blv", "could not load the level"),
        ("0 9", "unknown scene '9'; known: 0, 1, 2, 3"),
        ("8 what", "unknown command '8'"),
    ],
)
def test_what_it_cannot_do_is_told_and_does_not_stop_it(
    module_player: Player, command: str, complaint: str
) -> None:
    module_player.send(command)
    module_player.until(complaint)


@pytest.fixture(scope="module")
def module_player() -> Iterator[Player]:
    player = Player()
    yield player
    player.close()


def test_frames_may_come_in_pieces_and_several_at_once(module_player: Player) -> None:
    frames = b"".join(struct.pack("<I", 3) + f"0 {number}".encode() for number in (0, 1, 2))
    for k in range(0, len(frames), 5):
        module_player.socket.sendall(frames[k : k + 5])
        time.sleep(0.01)
    for message in ("BlackScreenLoaded", "MainMenuLoaded", "LevelSelectLoaded"):
        module_player.until(f"SendMessage: {message}")


@pytest.mark.parametrize(
    ("fault", "status"), [({"fault": "crash"}, 139), ({"fault": "freeze"}, None)]
)
def test_it_crashes_and_hangs_on_demand(
    path: Path, tmp_path: Path, fault: dict[str, str], status: int | None
) -> None:
    faults = tmp_path / "faults.json"
    faults.write_text(json.dumps([{**fault, "at": "open_machine"}]))
    player = Player("--faults", str(faults))
    try:
        player.send(f"2 {path}")
        if status is None:
            player.until("SendMessage: MainMenuLoaded")
            assert player.quiet_for(0.7)
            assert player.process.poll() is None
        else:
            assert player.process.wait(timeout=20) == status
    finally:
        player.close()


def test_it_knows_no_toolkit() -> None:
    code = (
        f"import sys; sys.path.insert(0, {str(SUPPORT)!r}); sys.modules['tkinter'] = None\n"
        "import stand_in_game.headless, stand_in_game.__main__"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
