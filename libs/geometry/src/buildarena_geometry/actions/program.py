"""The action that has a program act."""

from dataclasses import replace

from buildarena_geometry.actions.lookups import require_started
from buildarena_geometry.changes import Change
from buildarena_geometry.feedback import state as words
from buildarena_geometry.modules.parameters import ProgramText
from buildarena_geometry.state import MachineState


def set_controller(state: MachineState, program: ProgramText) -> Change:
    """Has a program act in place of the control sequence.

    Args:
        program: Lua that defines control(t, sense); an empty text leaves the control sequence.
    """
    require_started(state)
    after = replace(state, controller=program)
    return Change(after=after, render=lambda: words.controller(after))
