"""What documents say of the game is what logs and evidence say today."""

import pytest
from benchmarks.simulation import game_evidence
from benchmarks.simulation.game_evidence import MADE, ROOT, written
from support.evenings import packed


@pytest.mark.ci
@pytest.mark.parametrize("name", MADE)
def test_documents_have_what_is_made_today(name) -> None:
    assert (ROOT / name).read_text() == written(name), "run `make game-evidence`"


def test_evenings_are_told_of_beside_published_logs(tmp_path, monkeypatch) -> None:
    (tmp_path / "evening.zip").write_bytes(packed("probe", "expert-support-1"))
    monkeypatch.setattr(game_evidence, "EVENINGS", tmp_path)
    monkeypatch.setattr(game_evidence, "TRIALS", {})
    text = game_evidence.agreement_text()
    assert "Besiege 1.75-23370, mod 1.4:" in text
    assert "| support-1 | MuJoCo (version 7) | 1 | 100% | 3% to 100% |" in text
    assert "Contradicted: nothing." in text
