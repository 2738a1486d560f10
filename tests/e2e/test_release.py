"""One command makes a release: what it refuses, what it commits, and that the tag comes last."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
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
PACKAGES = "clients/cli libs/geometry integrations/inspect"


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
        run(where, "git", "config", f"user.{name}", value)
    run(where, "git", "add", "--all")
    run(where, "git", "commit", "--quiet", "--allow-empty", "--message", "As it is")
    return where


def run(where: Path, *words: str) -> str:
    done = subprocess.run(words, cwd=where, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def release(where: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "mk/release.py", *words],
        cwd=where,
        env={**os.environ, "MAKE": str(where / "make"), "PACKAGES": PACKAGES},
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_release_is_committed_built_and_then_tagged(clone) -> None:
    before = (clone / "CHANGELOG.md").read_text()
    done = release(clone, NEXT)
    assert done.returncode == 0, done.stderr
    made = (clone / "made").read_text().splitlines()
    assert made == ["release", "images", "docs", "build/openapi.json"]
    assert run(clone, "git", "status", "--porcelain") == ""
    assert run(clone, "git", "log", "-1", "--format=%s") == f"Release {NEXT}"
    assert run(clone, "git", "rev-parse", f"v{NEXT}^{{}}") == run(clone, "git", "rev-parse", "HEAD")
    # What was not released yet has the version's name, and there is room for what comes next.
    text = (clone / "CHANGELOG.md").read_text()
    _, rest = text.split("## Unreleased\n\n## ", 1)
    assert rest.startswith(f"{NEXT} — ")
    first = next(line for line in before.split("## Unreleased")[1].splitlines() if line[:2] == "- ")
    assert first in run(clone, "git", "tag", "--list", f"v{NEXT}", "--format=%(contents)")
    assert (clone / "dist/images/api.provenance.json").read_text().strip() == run(
        clone, "git", "rev-parse", "HEAD"
    )
    sums = dict(
        line.split("  ")[::-1] for line in (clone / "dist/SHA256SUMS").read_text().splitlines()
    )
    assert set(sums) == {
        "buildarena.whl",
        "images/api.provenance.json",
        f"buildarena-deploy-{NEXT}.tar.gz",
        f"buildarena-docs-{NEXT}.tar.gz",
        f"buildarena-openapi-{NEXT}.json",
    }
    run(clone / "dist", "sha256sum", "--check", "--quiet", "SHA256SUMS")
    run(clone / "dist", "tar", "xzf", f"buildarena-deploy-{NEXT}.tar.gz")
    compose = clone / f"dist/buildarena-deploy-{NEXT}/docker-compose.yml"
    assert f"BUILDARENA_VERSION:-{NEXT}" in compose.read_text()


def test_after_a_failure_the_same_version_is_released_from_what_was_mended(clone) -> None:
    (clone / "failing").write_text("images")
    done = release(clone, NEXT)
    assert (done.returncode, "`make images` failed; nothing was tagged" in done.stderr) == (1, True)
    assert run(clone, "git", "tag", "--list") == ""
    (clone / "failing").unlink()
    (clone / "README.md").write_text("mended\n")
    run(clone, "git", "commit", "--quiet", "--all", "--message", "Mended")
    assert release(clone, NEXT).returncode == 0
    assert run(clone, "git", "log", "-1", "--format=%s", f"v{NEXT}") == "Mended"
    assert (clone / "CHANGELOG.md").read_text().count(f"## {NEXT} — ") == 1


def test_a_version_that_can_not_be_given_leaves_all_as_it_was(clone) -> None:
    (clone / "mk/version.sh").write_text("echo half >>README.md; exit 1\n")
    run(clone, "git", "commit", "--quiet", "--all", "--message", "As it is")
    assert release(clone, NEXT).returncode == 1
    assert run(clone, "git", "status", "--porcelain") == ""
    assert run(clone, "git", "log", "-1", "--format=%s") == "As it is"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "'' is no version"),
        (("next",), "'next' is no version"),
        (("0.0.1",), "0.0.1 comes before"),
    ],
)
def test_what_is_no_next_version_is_refused(clone, words, said) -> None:
    done = release(clone, *words)
    assert (done.returncode, said in done.stderr) == (1, True)
    assert not (clone / "made").exists()


def test_changes_tags_and_an_empty_changelog_are_refused(clone) -> None:
    (clone / "README.md").write_text("changed\n")
    assert "there are changes:\n M README.md" in release(clone, NEXT).stderr
    run(clone, "git", "restore", ".")
    run(clone, "git", "tag", f"v{NEXT}")
    assert f"the tag v{NEXT} is there" in release(clone, NEXT).stderr
    run(clone, "git", "tag", "--delete", f"v{NEXT}")
    text = (clone / "CHANGELOG.md").read_text()
    (clone / "CHANGELOG.md").write_text(text.replace("## Unreleased", "## Unreleased\n\n## 0.1"))
    run(clone, "git", "commit", "--quiet", "--all", "--message", "Nothing new")
    assert "says nothing under '## Unreleased'" in release(clone, NEXT).stderr
