"""What users install: wheels of one version, and a demo, a report and pages from them alone."""

import json
import os
import re
import shlex
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from email.parser import Parser
from pathlib import Path

import httpx
import pytest

from buildarena_api.dashboard.files import FOLDER as PAGES
from buildarena_cli.local import free_port

ROOT = Path(__file__).parents[2]
PROJECTS = sorted(
    path
    for room in ("libs", "services", "clients", "integrations")
    for path in (ROOT / room).glob("*/pyproject.toml")
)
# Adapters to others' frameworks are installed by whoever uses those.
ADAPTERS = [path for path in PROJECTS if path.is_relative_to(ROOT / "integrations")]
ALL_MUST_RUN = bool(os.environ.get("CI"))
pytestmark = pytest.mark.timeout(400)
needs_pages = pytest.mark.skipif(
    not (PAGES / "index.html").is_file(), reason="the dashboard has not been built: make web"
)


def _needs(path: Path) -> str:
    found = project(path)
    return json.dumps([found["dependencies"], found.get("optional-dependencies", {})])


def project(path: Path) -> dict[str, object]:
    found: dict[str, object] = tomllib.loads(path.read_text())["project"]
    return found


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dist")
    built = subprocess.run(
        ["bash", "mk/dist.sh", str(folder)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert built.returncode == 0, built.stderr
    return folder


@pytest.fixture(scope="module")
def installed(dist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The programs of an environment that holds the wheels and what they need, nothing else."""
    folder = tmp_path_factory.mktemp("empty")
    venv, python = folder / "venv", str(folder / "venv/bin/python")
    _uv("venv", "--quiet", "--no-project", "--python", sys.executable, str(venv))
    words = ["--find-links", str(dist), "--constraint", str(dist / "constraints.txt")]
    done = _uv("pip", "install", "--quiet", "--python", python, *words, "buildarena", check=False)
    if done.returncode and not ALL_MUST_RUN and "Failed to fetch" in done.stderr:
        pytest.skip("installing the wheels needs a package index, and none answers")
    assert done.returncode == 0, done.stderr
    return venv / "bin"


@pytest.fixture(
    params=["3.11", *(pytest.param(later, marks=pytest.mark.nightly) for later in ("3.12", "3.13"))]
)
def interpreter(request: pytest.FixtureRequest) -> str:
    """A Python of a version that we promise; of others than this one, where it is found."""
    if sys.version_info[:2] == tuple(map(int, request.param.split("."))):
        return sys.executable
    found = _uv("python", "find", "--no-python-downloads", request.param, check=False)
    if found.returncode:
        pytest.skip(f"no Python {request.param} is on PATH")
    return found.stdout.strip()


def _uv(*words: str, check: bool = True) -> subprocess.CompletedProcess[str]:
    command = ["bash", str(ROOT / "mk/uv.sh"), *words]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=check)


def test_every_distribution_has_one_version_and_asks_for_its_siblings_of_the_same() -> None:
    versions = {path.parent.name: project(path)["version"] for path in PROJECTS}
    assert len(set(versions.values())) == 1, versions
    version = versions["buildarena"]
    for path in PROJECTS:
        siblings = re.findall(r'"(buildarena-[^"]+)"', _needs(path))
        assert [s for s in siblings if not s.endswith(f"=={version}")] == [], path
        for module in (path.parent / "src").glob("*/__init__.py"):
            assert not re.search(r'^__version__ = "', module.read_text(), re.MULTILINE), module


@pytest.mark.ci
def test_the_meta_distribution_installs_all_but_adapters(installed) -> None:
    listed = _uv("pip", "list", "--format", "json", "--python", str(installed / "python"))
    ours = {p["name"] for p in json.loads(listed.stdout) if p["name"].startswith("buildarena")}
    assert ours == {project(path)["name"] for path in PROJECTS if path not in ADAPTERS}


@pytest.mark.ci
def test_a_demo_runs_from_wheels_without_an_environment(dist, interpreter, tmp_path) -> None:
    """As `uvx` runs it: in a temporary environment, by the distribution's own command."""
    found = ["--find-links", str(dist), "--constraints", str(dist / "constraints.txt")]
    words = ["tool", "run", "--quiet", "--isolated", "--python", interpreter, *found]
    demo = ["demo", "--task", "support-1", "--data", str(tmp_path), "--port", str(free_port())]
    done = _uv(*words, "buildarena", *demo, check=False)
    if done.returncode and not ALL_MUST_RUN and "Failed to fetch" in done.stderr:
        pytest.skip("installing the wheels needs a package index, and none answers")
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"builtin/expert\*\s+4/4", done.stdout), done.stdout


@pytest.mark.ci
def test_the_client_alone_brings_nothing_else(dist, tmp_path) -> None:
    venv = tmp_path / "venv"
    _uv("venv", "--quiet", "--no-project", "--python", sys.executable, str(venv))
    words = ["--python", str(venv / "bin/python"), "--no-index", "--find-links", str(dist)]
    _uv("pip", "install", "--quiet", *words, "buildarena-client")
    listed = json.loads(_uv("pip", "list", "--format", "json", *words[:2]).stdout)
    assert [package["name"] for package in listed] == ["buildarena-client"]
    code = "from buildarena_client import Client; Client('http://127.0.0.1:1')"
    subprocess.run([str(venv / "bin/python"), "-c", code], cwd=tmp_path, check=True)


def test_a_new_version_goes_everywhere(tmp_path) -> None:
    for path in PROJECTS:
        copy = tmp_path / path.parent.relative_to(ROOT)
        copy.mkdir(parents=True)
        (copy / path.name).write_text(path.read_text())
    deployed = [
        ROOT / "docker-compose.yml",
        ROOT / ".env.example",
        *(ROOT / "deploy/kubernetes/overlays").glob("*/kustomization.yaml"),
    ]
    for path in deployed:
        target = tmp_path / path.relative_to(ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(path.read_text())
    packages = [str(tmp_path / path.parent.relative_to(ROOT)) for path in PROJECTS]
    script = ["bash", str(ROOT / "mk/version.sh")]
    done = subprocess.run(
        [*script, "7.1.0rc2", *packages], cwd=tmp_path, capture_output=True, check=False
    )
    assert done.returncode == 0
    for path in deployed:
        text = (tmp_path / path.relative_to(ROOT)).read_text()
        assert "7.1.0rc2" in text
        assert str(project(PROJECTS[0])["version"]) not in text
    old = str(project(PROJECTS[0])["version"])
    changed = [p.read_text() for p in tmp_path.rglob("*") if p.is_file()]
    assert not [text for text in changed if f'"{old}"' in text or f"=={old}" in text]
    assert sum('version = "7.1.0rc2"' in text for text in changed) >= len(PROJECTS)
    refused = subprocess.run([*script, "next"], capture_output=True, text=True, check=False)
    assert (refused.returncode, "'next' is no version" in refused.stderr) == (2, True)


@pytest.mark.ci
def test_wheels_and_sdists_say_what_they_are(dist) -> None:
    wheels, sdists = sorted(dist.glob("*.whl")), sorted(dist.glob("*.tar.gz"))
    assert len(wheels) == len(sdists) == len(PROJECTS)
    for wheel in wheels:
        with zipfile.ZipFile(wheel) as archive:
            names = archive.namelist()
            found = next(name for name in names if name.endswith(".dist-info/METADATA"))
            metadata = Parser().parsestr(archive.read(found).decode())
        assert metadata["License-Expression"] == "Apache-2.0"
        assert metadata["License-File"] == "LICENSE"
        assert metadata["Requires-Python"] == ">=3.11"
        assert metadata["Summary"]
        assert metadata["Keywords"]
        pythons = {f"Programming Language :: Python :: 3.{minor}" for minor in (11, 12, 13)}
        assert pythons <= set(metadata.get_all("Classifier", ()))
        assert str(metadata.get_payload()).startswith("# ")
        assert any(name.endswith("/py.typed") for name in names), wheel
    for sdist in sdists:
        with tarfile.open(sdist) as archive:
            inside = [name.split("/", 1)[1] for name in archive.getnames() if "/" in name]
        assert {"LICENSE", "README.md", "pyproject.toml", "PKG-INFO"} <= set(inside)
        hidden = [name for name in inside if any(part[0] == "." for part in name.split("/"))]
        assert not hidden, sdist


@pytest.mark.ci
def test_a_package_index_would_take_every_distribution(dist) -> None:
    makefile = (ROOT / "mk/release.mk").read_text()
    (twine,) = re.findall(r"^TWINE := (.+)$", makefile, re.MULTILINE)
    files = [str(file) for file in sorted(dist.glob("buildarena*"))]
    words = ["tool", "run", "--quiet", "--from", twine, "twine", "--no-color", "check", "--strict"]
    done = _uv(*words, *files, check=False)
    if done.returncode and not ALL_MUST_RUN and "Failed to fetch" in done.stderr:
        pytest.skip("twine comes from a package index, and none answers")
    assert done.returncode == 0, done.stdout
    assert done.stdout.count("PASSED") == len(files) == 2 * len(PROJECTS)


@pytest.mark.nightly
@pytest.mark.parametrize("adapter", ADAPTERS, ids=lambda path: path.parent.name)
def test_an_adapter_is_installed_by_its_readmes_command(
    dist, adapter, interpreter, tmp_path
) -> None:
    """In the versions of its lock, from wheels alone."""
    name = adapter.parent.name
    readme = (adapter.parent / "README.md").read_text()
    (command,) = re.findall(r"^pip install (.+ \"?buildarena-.+)$", readme, re.MULTILINE)
    (tmp_path / "dist").symlink_to(dist)
    python = str(tmp_path / "venv/bin/python")
    _uv("venv", "--quiet", "--no-project", "--python", interpreter, str(tmp_path / "venv"))
    words = ["--directory", str(tmp_path), "pip", "install", "--quiet", "--python", python]
    done = _uv(*words, *shlex.split(command), check=False)
    if done.returncode and not ALL_MUST_RUN and "Failed to fetch" in done.stderr:
        pytest.skip("installing the wheels needs a package index, and none answers")
    assert done.returncode == 0, done.stderr
    lines = (dist / f"constraints-{name}.txt").read_text().splitlines()
    tested = {line.partition(" ;")[0] for line in lines}
    frozen = _uv("pip", "freeze", "--python", python).stdout.splitlines()
    assert {line for line in frozen if not line.startswith("buildarena")} <= tested
    told = subprocess.run(
        [python, "-c", f"import buildarena_{name}"], env=alone(), check=False, cwd=tmp_path
    )
    assert told.returncode == 0


@pytest.mark.ci
def test_the_clients_types_are_written_when_it_is_built(dist) -> None:
    schemas = "buildarena_client/schemas.py"
    (wheel,) = dist.glob("buildarena_client-*.whl")
    (sdist,) = dist.glob("buildarena_client-*.tar.gz")
    with zipfile.ZipFile(wheel) as archive:
        text = archive.read(schemas)
    with tarfile.open(sdist) as archive:
        assert [name for name in archive.getnames() if name.endswith(schemas)]
    assert b"class JobDetail(TypedDict):" in text


def test_each_licence_is_the_repositorys() -> None:
    licence = (ROOT / "LICENSE").read_text()
    assert [p for p in PROJECTS if (p.parent / "LICENSE").read_text() != licence] == []


@pytest.mark.ci
@needs_pages
def test_a_notebook_draws_from_an_empty_environment(installed, tmp_path) -> None:
    code = (
        "import buildarena as ba; machine = ba.Machine(); machine.start(); "
        "print(machine._repr_mimebundle_()['text/html'])"
    )
    words = [str(installed / "python"), "-c", code]
    shown = subprocess.run(
        words, cwd=tmp_path, env=alone(), capture_output=True, text=True, check=False
    )
    assert shown.returncode == 0, shown.stderr
    assert "<iframe sandbox=" in shown.stdout
    assert len(shown.stdout) > 100_000


@pytest.mark.nightly
@needs_pages
def test_demo_exports_and_pages_run_from_an_empty_environment(installed, tmp_path) -> None:
    data = tmp_path / "data"
    words = ["demo", "--task", "support-1", "--data", str(data), "--port", str(free_port())]
    demo = run(installed, tmp_path, *words)
    assert demo.returncode == 0, demo.stdout + demo.stderr
    assert re.search(r"builtin/expert\*\s+4/4", demo.stdout), demo.stdout
    with up(installed, tmp_path, data / "demo") as url:
        page = httpx.get(url)
        assert "<!doctype html>" in page.text.lower()
        script = re.search(r'src="([^"]+\.js)"', page.text)
        assert script
        assert httpx.get(f"{url}{script[1]}").status_code == 200
        for ending in ("csv", "parquet", "tex"):
            out = tmp_path / f"board.{ending}"
            done = run(installed, tmp_path, "export", "--out", str(out), "--url", url)
            assert done.returncode == 0, done.stderr
            assert out.stat().st_size > 300


def run(programs: Path, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(programs / "buildarena"), *words],
        cwd=folder,
        env=alone(),
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def alone() -> dict[str, str]:
    """An environment in which nothing of the source tree is found."""
    kept = ("HOME", "LANG", "TMPDIR")
    return {name: os.environ[name] for name in kept if name in os.environ} | {
        "PATH": "/usr/bin:/bin"
    }


@contextmanager
def up(programs: Path, folder: Path, data: Path) -> Iterator[str]:
    port = str(free_port())
    started = run(programs, folder, "up", "--detach", "--data", str(data), "--port", port)
    assert started.returncode == 0, started.stderr
    try:
        yield f"http://127.0.0.1:{port}"
    finally:
        run(programs, folder, "down", "--data", str(data))
