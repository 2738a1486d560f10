"""Creation of a release: release.py VERSION.

The version is written into every distribution, image and manifest, the changelog's Unreleased
section gets its name and date, and both are committed. Everything is built from that commit, which
is then tagged. After a failure, fix its cause, commit it, and run the script again.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import NoReturn

from packaging.version import InvalidVersion, Version

ROOT = Path(__file__).parents[1]
CHANGELOG = ROOT / "CHANGELOG.md"
OUT = ROOT / "dist"
UNRELEASED = "## Unreleased"
DEPLOYED = ("deploy", "docker-compose.yml", ".env.example")
"""Files that a host needs in addition to the images."""


def refuse(reason: str) -> NoReturn:
    sys.exit(f"no release: {reason}")


def git(*args: str) -> str:
    done = subprocess.run(["git", *args], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout.rstrip()


def run(name: str, *args: str) -> None:
    print(f"== {name}", flush=True)
    if subprocess.run(args, cwd=ROOT, check=False).returncode:
        refuse(f"`{name}` failed; nothing was tagged")


def present() -> Version:
    text = (ROOT / "clients/cli/pyproject.toml").read_text()
    return Version(re.findall(r'^version = "(.*)"$', text, re.MULTILINE)[0])


def section(heading: str) -> str:
    """Return the changelog's text under a heading."""
    lines = CHANGELOG.read_text().splitlines()
    if heading not in lines:
        refuse(f"CHANGELOG.md has no line {heading!r}")
    lines = lines[lines.index(heading) + 1 :]
    end = next((i for i, line in enumerate(lines) if line.startswith("## ")), len(lines))
    return "\n".join(lines[:end]).strip()


def check(text: str) -> Version:
    """Return the version after checking that it can be released."""
    try:
        version = Version(text)
    except InvalidVersion:
        refuse(f"{text!r} is not a version: make release V=1.2.0, or V=1.2.0rc1")
    if changed := git("status", "--porcelain"):
        refuse(f"commit these changes first, as only committed files are released:\n{changed}")
    if git("tag", "--list", f"v{version}"):
        refuse(f"the tag v{version} exists")
    return version


def prepare(version: Version) -> None:
    """Commit the version and the changelog's new section."""
    if version < present():
        refuse(f"{version} comes before {present()}, the present version")
    if not section(UNRELEASED):
        refuse(f"CHANGELOG.md has no text under {UNRELEASED!r}")
    try:
        run("mk/version.sh", "bash", "mk/version.sh", str(version), *os.environ["PACKAGES"].split())
    except SystemExit:
        git("restore", ".")
        raise
    heading = f"{UNRELEASED}\n\n## {version} — {datetime.now(UTC):%Y-%m-%d}"
    CHANGELOG.write_text(CHANGELOG.read_text().replace(UNRELEASED, heading, 1))
    git("commit", "--quiet", "--all", "--message", f"Release {version}")


def heading_of(version: Version) -> str | None:
    lines = CHANGELOG.read_text().splitlines()
    return next((line for line in lines if line.startswith(f"## {version} ")), None)


def build(version: Version) -> None:
    """Build wheels, sdists, images, the contract, a host's files and the site, with hashes."""
    shutil.rmtree(OUT, ignore_errors=True)
    for target in ("images", "release", "docs", "build/openapi.json"):
        run(f"make {target}", os.environ.get("MAKE", "make"), target)
    shutil.copy(ROOT / "build/openapi.json", OUT / f"buildarena-openapi-{version}.json")
    name = OUT / f"buildarena-deploy-{version}"
    git("archive", f"--prefix={name.name}/", "--output", f"{name}.tar.gz", "HEAD", *DEPLOYED)
    site = OUT / f"buildarena-docs-{version}"
    shutil.make_archive(str(site), "gztar", ROOT / ".buildarena/docs")
    files = sorted(path for path in OUT.rglob("*") if path.is_file())
    sums = [
        f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.relative_to(OUT)}"
        for path in files
    ]
    (OUT / "SHA256SUMS").write_text("\n".join(sums) + "\n")


def main() -> None:
    version = check(sys.argv[1] if len(sys.argv) > 1 else "")
    if heading_of(version) is None:
        prepare(version)
    heading = heading_of(version) or ""
    build(version)
    git("tag", "--annotate", f"v{version}", "--message", f"{version}\n\n{section(heading)}")
    print(f"v{version} is tagged; {OUT} has what belongs to it. Then: git push --follow-tags")


main()
