"""What `make images` writes beside the images: bills of materials and statements of provenance."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator

ROOT = Path(__file__).parents[2]
TARGETS = ("api", "construct", "proxy", "simulate-mujoco", "simulate-pybullet", "tools")
DIGEST = "a" * 64
FILES = {
    "opt/buildarena/lib/python3.12/site-packages/numpy-2.4.6.dist-info/METADATA": (
        "Metadata-Version: 2.4\nName: NumPy\nVersion: 2.4.6\n\nThe package.\n"
    ),
    "var/lib/dpkg/status": (
        "Package: bash\nStatus: install ok installed\nVersion: 5.2\nArchitecture: amd64\n\n"
        "Package: perl-base\nStatus: purge ok not-installed\nVersion: 5.36\nArchitecture: amd64\n"
    ),
    "etc/passwd": "root:x:0:0::/root:/bin/sh\n",
}
DOCKER = f"""
import io, json, os, sys, tarfile
words = sys.argv[1:]
with open(os.environ["SAID"], "a") as said:
    said.write(json.dumps(words) + "\\n")
if words[0] == "export":
    with tarfile.open(fileobj=sys.stdout.buffer, mode="w|") as tar:
        for name, text in {FILES!r}.items():
            info = tarfile.TarInfo(name)
            info.size = len(text)
            tar.addfile(info, io.BytesIO(text.encode()))
elif words[0] == "create":
    print("container")
elif "{{{{.Id}}}}" in words:
    print("sha256:{DIGEST}")
elif "{{{{.Size}}}}" in words:
    print(400_000_000)
elif words[-1] == "version":
    print("v2.10.2 h1:abc=")
"""


@pytest.fixture
def repository(tmp_path) -> Path:
    """A clone with what building the images needs, and a Docker that only says what it is asked."""
    folder = tmp_path / "repository"
    for name in (
        "mk/images.py",
        "deploy/docker",
        "requirements.lock",
        "clients/cli/pyproject.toml",
    ):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, folder / name)
    docker = tmp_path / "docker"
    docker.write_text(f"#!{sys.executable}\n{DOCKER}")
    docker.chmod(0o755)
    who = ("-c", "user.name=a", "-c", "user.email=a@b")
    for words in (("init", "--quiet"), ("add", "."), (*who, "commit", "--quiet", "-m", "a")):
        subprocess.run(["git", *words], cwd=folder, check=True)
    return folder


def make(repository: Path) -> subprocess.CompletedProcess[str]:
    here = repository.parent
    return subprocess.run(
        [sys.executable, "mk/images.py", str(here / "out")],
        cwd=repository,
        env={**os.environ, "DOCKER": str(here / "docker"), "SAID": str(here / "said")},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.ci
def test_each_image_has_a_bill_of_materials_and_a_statement_of_provenance(repository) -> None:
    done = make(repository)
    assert done.returncode == 0, done.stderr
    out = repository.parent / "out"
    commit = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=repository, capture_output=True, text=True, check=True
    ).stdout.strip()
    for target in TARGETS:
        bill = (out / f"{target}.cdx.json").read_text()
        assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(bill) is None
        found = {component["purl"] for component in json.loads(bill)["components"]}
        assert {"pkg:pypi/numpy@2.4.6", "pkg:deb/debian/bash@5.2?arch=amd64"} <= found
        assert not [purl for purl in found if "perl" in purl], "it was purged"
        caddy = {purl for purl in found if "caddy" in purl}
        assert caddy == (
            {"pkg:golang/github.com/caddyserver/caddy/v2@v2.10.2"} if target == "proxy" else set()
        )
        statement = json.loads((out / f"{target}.provenance.json").read_text())
        assert statement["subject"][0]["digest"] == {"sha256": DIGEST}
        made = statement["predicate"]["buildDefinition"]
        assert made["externalParameters"]["target"] == target
        digests = [each["digest"] for each in made["resolvedDependencies"]]
        assert {"gitCommit": commit} in digests
        assert {"sha256": DIGEST} in digests, "of a base that is not pinned: what is here"
        locks = [each["uri"] for each in made["resolvedDependencies"] if ".lock" in each["uri"]]
        assert locks == ["file:requirements.lock"]
    said = [json.loads(line) for line in (repository.parent / "said").read_text().splitlines()]
    built = [words for words in said if words[0] == "build"]
    assert sorted(words[words.index("--target") + 1] for words in built) == sorted(TARGETS)
    assert all(f"org.opencontainers.image.revision={commit}" in words for words in built)
    assert sum(words[0] == "create" for words in said) == sum(words[0] == "rm" for words in said)


def test_what_is_not_committed_is_not_built(repository) -> None:
    (repository / "deploy/docker/base.sh").write_text("exit 1\n")
    done = make(repository)
    assert done.returncode != 0
    assert "deploy/docker/base.sh" in done.stderr
    assert not (repository.parent / "out").exists()
