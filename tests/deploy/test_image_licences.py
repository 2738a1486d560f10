"""Licence texts of LGPL, MPL and GPL parts go into the images."""

import importlib.util
import re
import shutil
import subprocess
import sys
from importlib.metadata import distributions
from pathlib import Path

import pytest
from support.documents.locks import image_locks

ROOT = Path(__file__).parents[2]
RECIPES = ROOT / "deploy/docker"
PROGRAM = RECIPES / "licences.py"
DOCKERFILE = (RECIPES / "Dockerfile").read_text()
needs_common_texts = pytest.mark.skipif(
    not Path("/usr/share/common-licenses/GPL-3").is_file(),
    reason="the texts that licences refer to are where Debian has them",
)


@pytest.fixture
def program():
    spec = importlib.util.spec_from_file_location("image_licences", PROGRAM)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def site(tmp_path) -> Path:
    """The metadata of what the images' locks hold, as it is installed here."""
    folder = tmp_path / "site-packages"
    names = set().union(*image_locks(tmp_path / "locks").values())
    for found in distributions():
        if re.sub(r"[-_.]+", "-", found.name).lower() in names:
            metadata = Path(str(found.locate_file(".")), f"{found._path.name}")
            shutil.copytree(metadata, folder / metadata.name)
    return folder


@pytest.mark.ci
@needs_common_texts
def test_each_part_that_wants_it_has_its_text(program, site, tmp_path) -> None:
    out = tmp_path / "licenses"
    copies = program.gathered(site, out)
    assert copies.keys() == {"certifi", "psycopg", "psycopg-binary"}
    assert "Mozilla Public License" in (out / "certifi/LICENSE").read_text()
    for name in ("psycopg", "psycopg-binary"):
        assert "GNU LESSER GENERAL PUBLIC LICENSE" in (out / name / "LICENSE.txt").read_text()
        assert "GNU GENERAL PUBLIC LICENSE" in (out / name / "GPL-3").read_text()
    assert program.gathered(site, out).keys() == copies.keys(), "layers run it again"


@pytest.mark.ci
def test_a_part_without_its_text_stops_the_build(program, site, tmp_path) -> None:
    (licence,) = site.glob("certifi-*.dist-info/licenses/LICENSE")
    licence.unlink()
    with pytest.raises(
        SystemExit, match=r"certifi: the text of its licence is not there .*MPL-2\.0"
    ):
        program.gathered(site, tmp_path / "licenses")


def test_the_program_needs_nothing_but_python(tmp_path) -> None:
    words = [sys.executable, "-I", "-S", str(PROGRAM), str(tmp_path / "licenses")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_every_layer_of_libraries_and_the_proxy_get_their_texts() -> None:
    assert "deploy/docker/licences.py" in DOCKERFILE.split("AS kit")[1].split("FROM ")[0]
    layers = (RECIPES / "environment.sh").read_text()
    filled = layers.split("requirements)")[1].split(";;")[0]
    assert '"$recipe/licences.py" "$environment/licenses"' in filled
    proxy = DOCKERFILE.split("FROM scratch AS proxy")[1]
    assert "COPY --from=kit /recipe/licenses /usr/share/licenses" in proxy
    for text in ("GPL-2", "Apache-2.0", "busybox-static/copyright", "ca-certificates/copyright"):
        assert text in DOCKERFILE.split("mkdir /recipe/licenses")[1].split("FROM ")[0]
    trimmed = (RECIPES / "trimmed.txt").read_text()
    assert "dist-info" not in trimmed
    assert "licen" not in trimmed.lower()
