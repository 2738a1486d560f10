"""Prepared runs played in a real Lua, and what they print."""

from support.lua_game import LuaGame, references_of

from buildarena_besiege import GameLog
from buildarena_besiege.exporting.probes import height_at
from buildarena_besiege.run import prepared_machine
from buildarena_geometry import KeyPress, Machine

RUN = "run-1"


def vehicle(*, cannon: bool = False) -> Machine:
    """A starting block on two wheels, with keys; and with a cannon and a torch, if wanted."""
    machine = Machine()
    act(machine, "start")
    act(machine, "attach_block_to", base_block="1", face="A", new_block="Powered Wheel")
    act(machine, "attach_block_to", base_block="1", face="B", new_block="Powered Wheel")
    act(machine, "attach_block_to", base_block="1", face="C", new_block="Small Wooden Block")
    act(machine, "change_control_key", block_id="2", action="spinning_forward", new_key="UpArrow")
    act(machine, "change_control_key", block_id="3", action="spinning_backward", new_key="Alpha2")
    if cannon:
        act(machine, "attach_block_to", base_block="4", face="E", new_block="Water Cannon")
        act(machine, "change_control_key", block_id="5", action="hold_to_fire", new_key="Alpha5")
    return machine


def act(machine: Machine, name: str, /, **arguments: object) -> None:
    outcome = machine.act(name, arguments)
    assert outcome.ok, outcome.text


def press(time_s: float, key: str, hold_for_s: float) -> KeyPress:
    return KeyPress(time_s=time_s, key=key, hold_for_s=hold_for_s)


def played(machine, scenario, *, controls=None, updates=None, run_id=RUN, **game) -> LuaGame:
    """A run's script, played in a Lua."""
    found = prepared_machine(machine, scenario, run_id=run_id, controls=controls)
    wanted = round(scenario.duration_s * 100) if updates is None else updates
    game.setdefault("ground", lambda east, north: height_at(scenario.terrain, east, north))
    return LuaGame(references_of(found.records), **game).play(found.script, wanted)


def log_of(game: LuaGame, run_id: str = RUN) -> GameLog:
    log = GameLog(run_id)
    log.read("\n".join(reversed(game.lines)))
    return log
