"""Makes a release: release.py VERSION.

The version goes into every distribution, image and manifest, what the changelog calls Unreleased gets
its name and date, and both are committed. Everything is built from that commit; only then is it
tagged. After a failure, mend what failed, commit it, and give the same version again.
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
"""What a host needs beside the images."""


def refuse(why: str) -> NoReturn:
    sys.exit(f"no release: {why}")


def git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout.rstrip()


def run(name: str, *words: str) -> None:
    print(f"== {name}", flush=True)
    if subprocess.run(words, cwd=ROOT, check=False).returncode:
        refuse(f"`{name}` failed; nothing was tagged")


def present() -> Version:
    text = (ROOT / "clients/cli/pyproject.toml").read_text()
    return Version(re.findall(r'^version = "(.*)"$', text, re.MULTILINE)[0])


def section(heading: str) -> str:
    """What the changelog says under a heading."""
    lines = CHANGELOG.read_text().splitlines()
    if heading not in lines:
        refuse(f"CHANGELOG.md has no line {heading!r}")
    rest = lines[lines.index(heading) + 1 :]
    end = next((i for i, line in enumerate(rest) if line.startswith("## ")), len(rest))
    return "\n".join(rest[:end]).strip()


def check(text: str) -> Version:
    """The version, if it can be released from what is here."""
    try:
        version = Version(text)
    except InvalidVersion:
        refuse(f"{text!r} is no version: make release V=1.2.0, or V=1.2.0rc1")
    if changed := git("status", "--porcelain"):
        refuse(f"only what is committed is released; there are changes:\n{changed}")
    if git("tag", "--list", f"v{version}"):
        refuse(f"the tag v{version} is there")
    return version


def prepare(version: Version) -> None:
    """Commits the version and the changelog's new section."""
    if version < present():
        refuse(f"{version} comes before {present()}, the present version")
    if not section(UNRELEASED):
        refuse(f"CHANGELOG.md says nothing under {UNRELEASED!r}")
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
    """Wheels, sdists, images, the contract, what a host needs, and the site, with their hashes."""
    shutil.rmtree(OUT, ignore_errors=True)
    for target in ("release", "images", "docs", "build/openapi.json"):
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
