"""What we depend on: every pin with its licence, from the real locks and what is installed."""

import json
import re
import subprocess
import sys
from importlib.metadata import PathDistribution
from pathlib import Path

import pytest
from support.documents.locks import image_locks

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "mk"))

import licences  # noqa: E402 - a program beside the packages


@pytest.fixture(scope="module")
def parts() -> dict[str, licences.Part]:
    return {part.name: part for part in licences.parts()}


@pytest.mark.ci
def test_every_pin_is_a_row(parts) -> None:
    for lock in ("requirements.lock", "integrations/inspect/requirements.lock"):
        pins = re.findall(r"^([a-z0-9._-]+)==", (ROOT / lock).read_text(), re.MULTILINE)
        assert {licences.normal(name) for name in pins} <= parts.keys()
    pages = json.loads((ROOT / "clients/web/package-lock.json").read_text())["packages"]
    assert len(parts) > 400
    assert parts["react"].version == pages["node_modules/react"]["version"]


@pytest.mark.ci
def test_licences_are_what_packages_say(parts) -> None:
    told = {
        name: (parts[name].licence, parts[name].kind) for name in ("psycopg", "certifi", "numpy")
    }
    assert told["psycopg"] == ("LGPL-3.0-only", "Copyleft Limited")
    assert told["certifi"] == ("MPL-2.0", "Copyleft Limited")
    assert told["numpy"][0].startswith("BSD-3-Clause")
    assert parts["mouseinfo"].kind == "Copyleft"
    assert parts["react"].licence == "MIT"
    assert parts["certifi"].of[0] == "product and tools"


@pytest.mark.ci
def test_no_licence_is_unknown(parts) -> None:
    assert [name for name, part in parts.items() if part.licence == licences.UNKNOWN] == []


@pytest.mark.ci
def test_copyleft_is_where_we_know_of_it(parts, tmp_path) -> None:
    """A new one in what the images hold is a decision, and its text goes into them."""
    images = set().union(*image_locks(tmp_path).values())
    found = {name for name in images if parts[licences.normal(name)].kind.startswith("Copyleft")}
    assert found == {"psycopg", "psycopg-binary", "certifi"}


@pytest.mark.parametrize(
    ("metadata", "licence"),
    [
        ("License-Expression: MIT OR Apache-2.0", "MIT OR Apache-2.0"),
        ("License: Apache License, Version 2.0", "Apache-2.0"),
        ("Classifier: License :: OSI Approved :: ISC License (ISCL)", "ISC"),
        ("License: Beerware of my own", licences.UNKNOWN),
        ("Summary: says nothing", licences.UNKNOWN),
    ],
)
def test_what_packages_write_is_read_or_unknown(tmp_path, metadata, licence) -> None:
    folder = tmp_path / "thing-1.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text(
        f"Metadata-Version: 2.4\nName: thing\nVersion: 1\n{metadata}\n"
    )
    assert licences.licence_of(PathDistribution(folder)) == licence


@pytest.mark.ci
def test_the_command_prints_a_table_and_json() -> None:
    words = [sys.executable, str(ROOT / "mk/licences.py")]
    table = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert "| psycopg | " in table
    rows = json.loads(subprocess.run([*words, "--json"], capture_output=True, check=True).stdout)
    assert len(rows) == len(table.splitlines()) - 2
