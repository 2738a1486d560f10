"""Machines with programs, and trials that take them, for tests of programs in the game."""

from support.machines.families import car

from buildarena_geometry import Machine
from buildarena_simulation import Scenario
from buildarena_simulation.offered import Senses
from buildarena_simulation.scenario import Control

AGENT = Control(mode="agent")


def drive(duration_s: float = 2.0, **changes) -> Scenario:
    changes.setdefault("senses", Senses(offers=("pose", "wheels", "joints", "blocks")))
    return Scenario(duration_s=duration_s, control=AGENT, **changes)


def program(body: str) -> str:
    return f"function control(t, sense)\n{body}\nend"


GO = program("return { spinning_forward = 1 }")


def piloted(text: str = GO, machine: Machine | None = None) -> Machine:
    return (machine or car(bound=False, drive=())).with_controller(text)
