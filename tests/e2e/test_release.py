"""What users install, and how a release is made: wheels of one version; the tag comes last."""

import json
import os
import re
import shlex
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest

from buildarena_api.dashboard import FOLDER as PAGES
from buildarena_cli.local.server import free_port

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("libs", "services", "clients", "integrations")
PROJECTS = sorted(path for room in ROOMS for path in (ROOT / room).glob("*/pyproject.toml"))
# Adapters to others' frameworks are installed by whoever uses those.
ADAPTERS = [path for path in PROJECTS if path.is_relative_to(ROOT / "integrations")]
ALL_MUST_RUN = bool(os.environ.get("CI"))
pytestmark = pytest.mark.timeout(400)


def project(path: Path) -> dict:
    return tomllib.loads(path.read_text())["project"]


VERSION = project(PROJECTS[0])["version"]


def run(where: Path, *words: str, check: bool = True, **more) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        words, cwd=where, capture_output=True, text=True, check=check, timeout=400, **more
    )


def uv(*words: str, offline: bool = True, where: Path = ROOT) -> subprocess.CompletedProcess[str]:
    """What uv does; where it needs a package index and none answers, the test is left out."""
    done = run(where, "bash", str(ROOT / "mk/uv.sh"), *words, check=offline)
    if done.returncode and not ALL_MUST_RUN and "Failed to fetch" in done.stderr:
        pytest.skip("a package index is needed, and none answers")
    assert done.returncode == 0, done.stdout + done.stderr
    return done


def alone() -> dict[str, str]:
    """An environment in which nothing of the source tree is found."""
    kept = {name: os.environ[name] for name in ("HOME", "LANG", "TMPDIR") if name in os.environ}
    return kept | {"PATH": "/usr/bin:/bin"}


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dist")
    run(ROOT, "bash", "mk/dist.sh", str(folder))
    return folder


@pytest.fixture(
    params=["3.11", *(pytest.param(later, marks=pytest.mark.nightly) for later in ("3.12", "3.13"))]
)
def interpreter(request: pytest.FixtureRequest) -> str:
    """A Python of a version that we promise; of others than this one, where it is found."""
    if sys.version_info[:2] == tuple(map(int, request.param.split("."))):
        return sys.executable
    words = ("bash", "mk/uv.sh", "python", "find", "--no-python-downloads", request.param)
    found = run(ROOT, *words, check=False)
    if found.returncode:
        pytest.skip(f"no Python {request.param} is on PATH")
    return found.stdout.strip()


@pytest.mark.ci
def test_a_demo_runs_from_the_wheels_alone_without_adapters(dist, interpreter, tmp_path) -> None:
    venv = tmp_path / "venv"
    uv("venv", "--quiet", "--no-project", "--python", interpreter, str(venv))
    words = ["--find-links", str(dist), "--constraint", str(dist / "constraints.txt")]
    python = ["--python", str(venv / "bin/python")]
    uv("pip", "install", "--quiet", *python, *words, "buildarena", offline=False)
    listed = json.loads(uv("pip", "list", "--format", "json", *python).stdout)
    ours = {each["name"] for each in listed if each["name"].startswith("buildarena")}
    assert ours == {project(path)["name"] for path in PROJECTS if path not in ADAPTERS}
    demo = ["demo", "--task", "support-1", "--data", str(tmp_path / "d")]
    demo += ["--port", str(free_port())]
    done = run(tmp_path, str(venv / "bin/buildarena"), *demo, check=False, env=alone())
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"builtin/expert\*\s+4/4", done.stdout), done.stdout
    code = (
        "import buildarena as ba; machine = ba.Machine(); machine.start(); "
        "print(machine._repr_mimebundle_()['text/html'])"
    )
    if (PAGES / "index.html").is_file():
        shown = run(tmp_path, str(venv / "bin/python"), "-c", code, env=alone())
        assert "<iframe sandbox=" in shown.stdout
        assert len(shown.stdout) > 100_000


@pytest.mark.ci
def test_wheels_and_sdists_say_what_they_are(dist) -> None:
    wheels, sdists = sorted(dist.glob("*.whl")), sorted(dist.glob("*.tar.gz"))
    assert len(wheels) == len(sdists) == len(PROJECTS)
    for wheel in wheels:
        with zipfile.ZipFile(wheel) as archive:
            names = archive.namelist()
            found = next(name for name in names if name.endswith(".dist-info/METADATA"))
            metadata = Parser().parsestr(archive.read(found).decode())
        said = {name: metadata[name] for name in ("License-Expression", "Requires-Python")}
        assert said == {"License-Expression": "Apache-2.0", "Requires-Python": ">=3.11"}
        assert all(metadata[name] for name in ("License-File", "Summary", "Keywords")), wheel
        assert any(name.endswith("/py.typed") for name in names), wheel
    for sdist in sdists:
        with tarfile.open(sdist) as archive:
            inside = [name.split("/", 1)[1] for name in archive.getnames() if "/" in name]
        assert {"LICENSE", "README.md", "pyproject.toml", "PKG-INFO"} <= set(inside)
        assert not [name for name in inside if re.search(r"(^|/)\.", name)], sdist
    makefile = (ROOT / "mk/release.mk").read_text()
    (twine,) = re.findall(r"^TWINE := (.+)$", makefile, re.MULTILINE)
    files = [str(file) for file in sorted(dist.glob("buildarena*"))]
    words = ["tool", "run", "--quiet", "--from", twine, "twine", "--no-color", "check", "--strict"]
    assert uv(*words, *files, offline=False).stdout.count("PASSED") == len(files)


@pytest.mark.nightly
@pytest.mark.parametrize("adapter", ADAPTERS, ids=lambda path: path.parent.name)
def test_an_adapter_installs_by_its_readmes_command(dist, adapter, interpreter, tmp_path) -> None:
    """In the versions of its lock, from wheels alone."""
    name = adapter.parent.name
    readme = (adapter.parent / "README.md").read_text()
    (command,) = re.findall(r"^pip install (.+ \"?buildarena-.+)$", readme, re.MULTILINE)
    (tmp_path / "dist").symlink_to(dist)
    python = str(tmp_path / "venv/bin/python")
    uv("venv", "--quiet", "--no-project", "--python", interpreter, str(tmp_path / "venv"))
    words = ["--directory", str(tmp_path), "pip", "install", "--quiet", "--python", python]
    uv(*words, *shlex.split(command), offline=False)
    lines = (dist / f"constraints-{name}.txt").read_text().splitlines()
    tested = {line.partition(" ;")[0] for line in lines}
    frozen = uv("pip", "freeze", "--python", python).stdout.splitlines()
    assert {line for line in frozen if not line.startswith("buildarena")} <= tested
    run(tmp_path, python, "-c", f"import buildarena_{name}", env=alone())


def test_every_distribution_has_one_version_and_asks_for_its_siblings_of_the_same() -> None:
    licence = (ROOT / "LICENSE").read_text()
    for path in PROJECTS:
        found = project(path)
        assert found["version"] == VERSION, path
        needs = json.dumps([found["dependencies"], found.get("optional-dependencies", {})])
        siblings = re.findall(r'"(buildarena-[^"]+)"', needs)
        assert [s for s in siblings if not s.endswith(f"=={VERSION}")] == [], path
        assert (path.parent / "LICENSE").read_text() == licence, path


def test_a_new_version_goes_everywhere(tmp_path) -> None:
    overlays = (ROOT / "deploy/kubernetes/overlays").glob("*/kustomization.yaml")
    deployed = [ROOT / "docker-compose.yml", ROOT / ".env.example", *overlays]
    for path in (*PROJECTS, *deployed):
        copy = tmp_path / path.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(path.read_text())
    script = ["bash", str(ROOT / "mk/version.sh")]
    run(tmp_path, *script, "7.1.0rc2", *(str(path.parent.relative_to(ROOT)) for path in PROJECTS))
    for path in (*PROJECTS, *deployed):
        text = (tmp_path / path.relative_to(ROOT)).read_text()
        assert "7.1.0rc2" in text, path
        assert not re.search(rf'(=="?|[":]){re.escape(VERSION)}(?=["\s])', text), path
    refused = run(tmp_path, *script, "next", check=False)
    assert (refused.returncode, "'next' is no version" in refused.stderr) == (2, True)


# What `make` builds has tests of its own.
MAKE = """#!/bin/bash
echo "$@" >>made
[ "$1" = "$(cat failing 2>/dev/null)" ] && exit 1
case $1 in
release) mkdir -p dist && echo wheel >dist/buildarena.whl ;;
images) mkdir -p dist/images && git rev-parse HEAD >dist/images/api.provenance.json ;;
docs) mkdir -p .buildarena/docs && echo page >.buildarena/docs/index.html ;;
build/openapi.json) mkdir -p build && echo "{}" >build/openapi.json ;;
esac
"""
NEXT = "99.1.0"


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A clone in which a release can be made, with what is not committed yet."""
    where = tmp_path / "clone"
    run(tmp_path, "git", "clone", "--quiet", str(ROOT), str(where))
    (where / "mk/release.py").write_text((ROOT / "mk/release.py").read_text())
    (where / "make").write_text(MAKE)
    (where / "make").chmod(0o755)
    (where / ".git/info/exclude").write_text("/made\n/make\n/failing\n")
    for name, value in (("name", "A Person"), ("email", "person@example.org")):
        git(where, "config", f"user.{name}", value)
    commit(where, "As it is")
    return where


def git(where: Path, *words: str) -> str:
    return run(where, "git", *words).stdout.strip()


def commit(where: Path, message: str) -> None:
    git(where, "add", "--all")
    git(where, "commit", "--quiet", "--allow-empty", "--message", message)


def release(where: Path, *words: str) -> subprocess.CompletedProcess[str]:
    packages = "clients/cli libs/geometry integrations/inspect"
    environment = {**os.environ, "MAKE": str(where / "make"), "PACKAGES": packages}
    return run(where, sys.executable, "mk/release.py", *words, check=False, env=environment)


def test_a_release_is_committed_built_and_then_tagged_also_after_a_failure(clone) -> None:
    before = (clone / "CHANGELOG.md").read_text()
    (clone / "failing").write_text("images")
    done = release(clone, NEXT)
    assert (done.returncode, "`make images` failed; nothing was tagged" in done.stderr) == (1, True)
    assert git(clone, "tag", "--list") == ""
    (clone / "failing").unlink()
    (clone / "made").unlink()
    (clone / "README.md").write_text("mended\n")
    commit(clone, "Mended")
    done = release(clone, NEXT)
    assert done.returncode == 0, done.stderr
    made = (clone / "made").read_text().splitlines()
    assert made == ["images", "release", "docs", "build/openapi.json"]
    assert git(clone, "status", "--porcelain") == ""
    assert git(clone, "log", "-2", "--format=%s") == f"Mended\nRelease {NEXT}"
    head = git(clone, "rev-parse", "HEAD")
    assert git(clone, "rev-parse", f"v{NEXT}^{{}}") == head
    # What was not released yet has the version's name, and there is room for what comes next.
    _, rest = (clone / "CHANGELOG.md").read_text().split("## Unreleased\n\n## ", 1)
    assert rest.startswith(f"{NEXT} — ")
    first = next(line for line in before.split("## Unreleased")[1].splitlines() if line[:2] == "- ")
    assert first in git(clone, "tag", "--list", f"v{NEXT}", "--format=%(contents)")
    assert (clone / "dist/images/api.provenance.json").read_text().strip() == head
    sums = (clone / "dist/SHA256SUMS").read_text().splitlines()
    assert {line.split("  ")[1] for line in sums} == {
        *("buildarena.whl", "images/api.provenance.json", f"buildarena-deploy-{NEXT}.tar.gz"),
        *(f"buildarena-docs-{NEXT}.tar.gz", f"buildarena-openapi-{NEXT}.json"),
    }
    run(clone / "dist", "sha256sum", "--check", "--quiet", "SHA256SUMS")
    run(clone / "dist", "tar", "xzf", f"buildarena-deploy-{NEXT}.tar.gz")
    compose = clone / f"dist/buildarena-deploy-{NEXT}/docker-compose.yml"
    assert f"BUILDARENA_VERSION:-{NEXT}" in compose.read_text()


def test_what_can_not_be_released_is_refused_and_leaves_all_as_it_was(clone) -> None:
    def refused(said: str, *words: str) -> None:
        done = release(clone, *words)
        assert (done.returncode, said in done.stderr) == (1, True), done.stderr
        assert not (clone / "made").exists()

    refused("'' is not a version")
    refused("'next' is not a version", "next")
    refused("0.0.1 comes before", "0.0.1")
    (clone / "README.md").write_text("changed\n")
    refused("only committed files are released:\n M README.md", NEXT)
    git(clone, "restore", ".")
    git(clone, "tag", f"v{NEXT}")
    refused(f"the tag v{NEXT} exists", NEXT)
    git(clone, "tag", "--delete", f"v{NEXT}")
    text = (clone / "CHANGELOG.md").read_text()
    (clone / "CHANGELOG.md").write_text(text.replace("## Unreleased", "## Unreleased\n\n## 0.1"))
    commit(clone, "Nothing new")
    refused("has no text under '## Unreleased'", NEXT)
    (clone / "CHANGELOG.md").write_text(text)
    (clone / "mk/version.sh").write_text("echo half >>README.md; exit 1\n")
    commit(clone, "It fails half way")
    refused("", NEXT)
    assert git(clone, "status", "--porcelain") == ""
    assert git(clone, "log", "-1", "--format=%s") == "It fails half way"
