import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.game.game_rig import Rig
from support.game.virtual_screen import missing_packages, virtual_screen


@pytest.fixture(autouse=True)
def _locks_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A game's lock outlives its runner: here it goes with the test's folder."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))


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


@pytest.fixture
def clean(rig: Rig) -> Iterator[Rig]:
    """Ends the game that runners leave running."""
    yield rig
    rig.end_game()
