"""What documents, messages and advice name exists: files, modules, targets, commands, variables.

Links are `mkdocs build --strict`'s.
"""

import re
from collections.abc import Iterator
from pathlib import Path

from typer.main import get_command

from buildarena_backend.settings import Settings
from buildarena_cli.main import app
from buildarena_simworker.besiege.settings import BesiegeSettings

COMMANDS = get_command(app).commands
ADMIN = COMMANDS["admin"].commands
ROOT = Path(__file__).parents[1]
KINDS = ("libs", "services", "clients", "integrations")
SOURCES = [folder for kind in KINDS for folder in ROOT.glob(f"{kind}/*/src")]
PATTERNS = ("*.md", "docs/**/*.md", "libs/*/README.md", "libs/*/src/**/README.md")
PATTERNS += ("clients/*/README.md", "integrations/*/README.md")
# The changelog names what modules were called before.
DOCUMENTS = [
    file for each in PATTERNS for file in sorted(ROOT.glob(each)) if file.name != "CHANGELOG.md"
]
PATH = re.compile(
    r"`((?:libs|services|clients|integrations|tests|scenarios|benchmarks|examples|docs|deploy|mk)"
    r"/[\w./*-]+)`"
)
MAKEFILES = "\n".join(f.read_text() for f in [ROOT / "Makefile", *ROOT.glob("mk/*.mk")])
TARGETS = set(re.findall(r"^([a-z0-9-]+):", MAKEFILES, re.MULTILINE))
VARIABLE = re.compile(r"\bBUILDARENA_([A-Z0-9]+(?:_[A-Z0-9]+)*)\b(?!_)")
WITHOUT_SETTINGS = {"CATEGORIES", "URL", "KEY", "BLAS_KERNELS", "PARENT_PID", "CHROMIUM"}
"""Read before, or without, a process' settings."""


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


def missing_in(text: str) -> Iterator[str]:
    """What a document names and nothing is."""
    yield from (name for name in PATH.findall(text) if not list(ROOT.glob(name)))
    for name in re.findall(r"`(buildarena_\w+/[\w./-]+\.\w+)`", text):
        if not any((source / name).is_file() for source in SOURCES):
            yield name
    for name in set(re.findall(r"`(buildarena_[a-z]+(?:[./]\w+)*)", text)):
        if not exists_as_module(name.removesuffix(".py").replace("/", ".")):
            yield name
    yield from set(re.findall(r"`make ([a-z0-9-]+)", text)) - TARGETS
    yield from set(re.findall(r"(?<!import )\bbuildarena ([a-z]+)\b", text)) - COMMANDS.keys()
    yield from set(re.findall(r"\b(?:buildarena|tools) admin ([a-z]+)\b", text)) - ADMIN.keys()


def test_what_documents_name_exists() -> None:
    assert len(DOCUMENTS) > 30
    missing = {str(f.relative_to(ROOT)): list(missing_in(f.read_text())) for f in DOCUMENTS}
    assert not {file: names for file, names in missing.items() if names}


def test_no_place_names_a_variable_that_nothing_reads() -> None:
    own = {name.upper() for name in Settings.model_fields}
    game = {f"BESIEGE_{name.upper()}" for name in BesiegeSettings.model_fields}
    read = (
        own | game | WITHOUT_SETTINGS | set(VARIABLE.findall((ROOT / ".env.example").read_text()))
    )
    places = [file for source in SOURCES for file in source.rglob("*.py")]
    places += [*DOCUMENTS, ROOT / "deploy/monitoring/prometheus/alerts.yml"]
    told = [(place, name) for place in places for name in VARIABLE.findall(place.read_text())]
    unread = [(p, name) for p, name in told if not {name, name.removesuffix("_FILE")} & read]
    unknown = {f"{place.relative_to(ROOT)}: {name}" for place, name in unread}
    assert not unknown, f"nothing reads {sorted(unknown)}"
