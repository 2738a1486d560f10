from collections.abc import Iterator
from pathlib import Path

import pytest
from game_rig import Rig
from virtual_screen import missing_packages, virtual_screen


@pytest.fixture(scope="session")
def screen() -> Iterator[dict[str, str]]:
    """The environment of programs on a screen of this test worker's own."""
    if missing_packages():
        pytest.skip(missing_packages())
    with virtual_screen() as environment:
        yield environment


@pytest.fixture
def rig(tmp_path: Path) -> Rig:
    """A runner's folder, calibrated for the stand-in."""
    rig = Rig(folder=tmp_path / "rig")
    rig.calibrate()
    return rig
