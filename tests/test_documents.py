"""What documents name exists: links, files, modules, make targets and commands."""

import re
from pathlib import Path

import pytest

from buildarena_cli.command_table import ADMIN, COMMANDS

ROOT = Path(__file__).parents[1]
SOURCES = [
    folder
    for kind in ("libs", "services", "clients", "integrations")
    for folder in ROOT.glob(f"{kind}/*/src")
]
# It names what modules were called before.
RENAMES = "CHANGELOG.md"
DOCUMENTS = [
    file
    for pattern in (
        *("*.md", "docs/**/*.md", "libs/*/README.md", "libs/*/src/**/README.md"),
        "clients/*/README.md",
        "integrations/*/README.md",
    )
    for file in sorted(ROOT.glob(pattern))
    if file.name != RENAMES
]


@pytest.fixture(params=DOCUMENTS, ids=lambda file: str(file.relative_to(ROOT)))
def document(request) -> Path:
    return request.param


def exists_as_module(name: str) -> bool:
    """Whether a dotted name is a package, a module, or a name that a module has."""
    parts = name.split(".")
    for source in SOURCES:
        place = source.joinpath(*parts)
        if place.is_dir() or place.with_suffix(".py").is_file():
            return True
        module = source.joinpath(*parts[:-1])
        for file in (module / "__init__.py", module.with_suffix(".py")):
            if file.is_file() and re.search(rf"\b{parts[-1]}\b", file.read_text()):
                return True
    return False


def test_links_lead_somewhere(document) -> None:
    prose = re.sub(r"^```.*?^```$", "", document.read_text(), flags=re.MULTILINE | re.DOTALL)
    targets = re.findall(r"\]\(([^)#\s]+)", prose)
    missing = [t for t in targets if "://" not in t and not (document.parent / t).exists()]
    assert not missing


def test_files_exist(document) -> None:
    named = re.findall(
        r"`((?:libs|services|clients|integrations|tests|scenarios|benchmarks|examples|docs|deploy|mk)/[\w./*-]+)`",
        document.read_text(),
    )
    assert not [name for name in named if not list(ROOT.glob(name))]


def test_files_of_packages_exist(document) -> None:
    """Files that are named from their package on, such as `buildarena_environment/briefing.md`."""
    named = re.findall(r"`(buildarena_\w+/[\w./-]+\.\w+)`", document.read_text())
    assert not [name for name in named if not any((s / name).is_file() for s in SOURCES)]


def test_modules_exist(document) -> None:
    named = re.findall(r"`(buildarena_[a-z]+(?:[./]\w+)*)", document.read_text())
    dotted = {name.removesuffix(".py").replace("/", ".") for name in named}
    assert not [name for name in sorted(dotted) if not exists_as_module(name)]


def test_make_targets_exist(document) -> None:
    makefiles = "\n".join(f.read_text() for f in [ROOT / "Makefile", *ROOT.glob("mk/*.mk")])
    targets = set(re.findall(r"^([a-z0-9-]+):", makefiles, re.MULTILINE))
    assert set(re.findall(r"`make ([a-z0-9-]+)", document.read_text())) <= targets


def test_commands_exist(document) -> None:
    named = set(re.findall(r"(?<!import )\bbuildarena ([a-z]+)\b", document.read_text()))
    assert named <= COMMANDS.keys()
    operating = set(re.findall(r"\b(?:buildarena|tools) admin ([a-z]+)\b", document.read_text()))
    assert operating <= ADMIN.keys()
