"""`buildarena besiege evidence`: sent, listed, shown."""

import json

import pytest
from support.clients.commands import run
from support.evenings import packed, repacked

pytestmark = pytest.mark.nightly


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "evidence.zip"
    path.write_bytes(packed("doctor", "probe", "expert-support-1"))
    return path


def test_evidence_is_sent_once_listed_and_shown(url, file) -> None:
    first = run("besiege", "evidence", "add", str(file), "--url", url)
    assert first.returncode == 0, first.stderr
    assert "added" in first.stdout
    assert "8 confirmed, 1 not seen" in first.stdout
    again = run("besiege", "evidence", "add", str(file), "--url", url)
    assert "was there before; nothing changed" in again.stdout
    (row,) = json.loads(run("besiege", "evidence", "list", "--url", url, "--json").stdout)
    assert row["id"][:12] in run("besiege", "evidence", "list", "--url", url).stdout
    shown = run("besiege", "evidence", "show", row["id"][:6], "--url", url).stdout
    assert "no function of the mod tells a body's mass" in shown
    assert "100% (3% to 100%)" in shown


def test_what_differs_is_said(url, file) -> None:
    spoiled = repacked(
        file.read_bytes(), lambda members: members.update({"steps/probe/log-1.txt": b""})
    )
    file.write_bytes(spoiled)
    done = run("besiege", "evidence", "add", str(file), "--url", url)
    assert done.returncode == 0
    assert "4 verdicts of its sender are not what its files show" in done.stderr
    (row,) = json.loads(run("besiege", "evidence", "list", "--url", url, "--json").stdout)
    shown = run("besiege", "evidence", "show", row["id"], "--url", url).stdout
    assert "not seen (its sender: confirmed)" in shown


def test_refusals_name_what_is_wrong(url, tmp_path) -> None:
    missing = run("besiege", "evidence", "add", str(tmp_path / "x.zip"), "--url", url)
    assert (missing.returncode, "x.zip" in missing.stderr) == (2, True)
    (tmp_path / "x.zip").write_bytes(b"PK")
    refused = run("besiege", "evidence", "add", str(tmp_path / "x.zip"), "--url", url)
    assert (refused.returncode, "no sound ZIP file" in refused.stderr) == (1, True)
    unknown = run("besiege", "evidence", "show", "abcd", "--url", url)
    assert (unknown.returncode, "there is no evidence abcd" in unknown.stderr) == (1, True)
