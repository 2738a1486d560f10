"""Loaded once, before drives are forked from the process that loaded it: they start at once."""

from buildarena_api.driving import wheel  # noqa: F401 - what it imports is loaded by it
from buildarena_geometry import Machine
from buildarena_simulation import ENGINES, KeyDrive, Scenario


def _load() -> None:
    """Engines and linear algebra are loaded with the first tick."""
    machine = Machine()
    machine.act("start", {})
    for engine in ENGINES:
        drive = KeyDrive(machine, Scenario(duration_s=1.0), engine)
        drive.step(())
        drive.close()


_load()
