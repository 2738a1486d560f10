"""The action that has a program act."""

from dataclasses import replace

from buildarena_geometry.actions.lookups import require_started
from buildarena_geometry.actions.parameters import ProgramText
from buildarena_geometry.feedback import state as words
from buildarena_geometry.state import Change, MachineState


def set_controller(state: MachineState, program: ProgramText) -> Change:
    """Set the program that acts in place of key presses.

    Args:
        program: Lua that defines control(t, sense); an empty text removes it.
    """
    require_started(state)
    after = replace(state, controller=program)
    return Change(after=after, render=lambda: words.controller(after))
