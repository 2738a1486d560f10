"""The faults that stop the whole process, with a window or without."""

import os
import time
from typing import Final

from support.game.stand_in_game.faults import Fault

_CRASHED: Final = 139
"""The exit status a shell shows for a segmentation fault."""


def freeze(fault: Fault) -> None:
    """Does nothing for the fault's seconds, or forever: no event is answered."""
    end = time.monotonic() + fault.number("seconds", 0.0)
    while fault.for_ever or time.monotonic() < end:
        time.sleep(0.05)


def crash() -> None:
    """Ends the process at once, with nothing tidied up."""
    os._exit(_CRASHED)
