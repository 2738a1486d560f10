"""Variables that advice, messages and documents name are variables that something reads."""

import re
from pathlib import Path

from buildarena_pipeline.runtime.settings import Settings
from buildarena_simworker_besiege.settings import BesiegeSettings

ROOT = Path(__file__).parents[1]
NAME = re.compile(r"\bBUILDARENA_[A-Z0-9]+(?:_[A-Z0-9]+)*\b(?!_)")
WITHOUT_SETTINGS = {"URL", "KEY", "BLAS_KERNELS", "PARENT_PID"}
"""Read before, or without, a process' settings."""
OF_TESTS = {"CHROMIUM"}
SOURCES = [
    *ROOT.glob("libs/*/src/**/*.py"),
    *ROOT.glob("services/*/src/**/*.py"),
    *ROOT.glob("clients/*/src/**/*.py"),
    *ROOT.glob("docs/*.md"),
    *ROOT.glob("clients/*/README.md"),
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    ROOT / "deploy/monitoring/prometheus/alerts.yml",
]


def known() -> set[str]:
    """Names after ``BUILDARENA_``."""
    own = {name.upper() for name in Settings.model_fields}
    game = {f"BESIEGE_{name.upper()}" for name in BesiegeSettings.model_fields}
    compose = {name.removeprefix("BUILDARENA_") for name in names(ROOT / ".env.example")}
    return own | game | compose | WITHOUT_SETTINGS | OF_TESTS


def names(path: Path) -> list[str]:
    return NAME.findall(path.read_text())


def test_no_place_names_a_variable_that_nothing_reads() -> None:
    read = known()
    unknown = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in SOURCES
        for name in names(path)
        if not {
            name.removeprefix("BUILDARENA_"),
            name.removeprefix("BUILDARENA_").removesuffix("_FILE"),
        }
        & read
    }
    assert not unknown, f"nothing reads {sorted(unknown)}"


def test_most_places_name_variables() -> None:
    assert sum(bool(names(path)) for path in SOURCES) > 20
