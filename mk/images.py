"""Builds the images of the services, and writes beside them what is in each and how it was made.

`images.py FOLDER` writes NAME.cdx.json, a bill of materials in CycloneDX, and NAME.provenance.json, a
statement in the form of in-toto with SLSA's predicate. Both say the image's digest. It builds what is
committed and nothing else, so that the statement can be held against the repository.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys
import tarfile
import tomllib
from collections.abc import Iterator
from datetime import UTC, datetime
from email.parser import Parser
from pathlib import Path
from typing import Any

from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.output.json import JsonV1Dot6
from packageurl import PackageURL

ROOT = Path(__file__).parents[1]
RECIPE = "deploy/docker/Dockerfile"
TARGETS = ("api", "construct", "simulate-pybullet", "simulate-mujoco", "tools", "proxy")
VERSION = tomllib.loads((ROOT / "clients/cli/pyproject.toml").read_text())["project"]["version"]
PYTHON = re.compile(r"[^/]+\.dist-info/METADATA$")
DEBIAN = re.compile(r"^var/lib/dpkg/status$|^var/lib/dpkg/status\.d/[^/]+$")


def said(*words: str) -> str:
    done = subprocess.run(words, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout.strip()


def docker(*words: str) -> str:
    return said(os.environ.get("DOCKER", "docker"), *words)


def source() -> str:
    """Where the repository was cloned from; "." where it was not."""
    words = ("git", "config", "--get", "remote.origin.url")
    done = subprocess.run(words, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
    return done.stdout.strip() or "."


def bases() -> dict[str, str]:
    """The base images by the recipe's arguments: what the environment says, or the recipe."""
    found = re.findall(r"^ARG (\w+_IMAGE)=(\S+)$", (ROOT / RECIPE).read_text(), re.MULTILINE)
    return {name: os.environ.get(name) or default for name, default in found}


def digest_of(image: str) -> str:
    """The digest that an image is pinned to, or that of its content here."""
    pinned = image.partition("@sha256:")[2]
    return pinned or docker("image", "inspect", "--format", "{{.Id}}", image).partition(":")[2]


def build(target: str, commit: str) -> str:
    image = f"buildarena/{target}:{VERSION}"
    words = [w for name, base in bases().items() for w in ("--build-arg", f"{name}={base}")]
    labels = {"revision": commit, "version": VERSION, "title": f"BuildArena {target}"}
    words += [
        w for k, v in labels.items() for w in ("--label", f"org.opencontainers.image.{k}={v}")
    ]
    os.environ["DOCKER_BUILDKIT"] = "1"
    docker("build", "--quiet", "--file", RECIPE, *words, "--target", target, "--tag", image, ".")
    return image


def packages(image: str) -> Iterator[PackageURL]:
    """What is installed in an image, by the records of pip and dpkg in its files."""
    container = docker("create", image)
    command = [os.environ.get("DOCKER", "docker"), "export", container]
    try:
        with (
            subprocess.Popen(command, stdout=subprocess.PIPE) as exporting,
            tarfile.open(fileobj=exporting.stdout, mode="r|") as files,
        ):
            for file in files:
                name = file.name.removeprefix("./")
                if not file.isfile() or not (PYTHON.search(name) or DEBIAN.search(name)):
                    continue
                opened = files.extractfile(file)
                text = opened.read().decode(errors="replace") if opened else ""
                for record in text.strip().split("\n\n") if DEBIAN.search(name) else [text]:
                    yield from _package(record, "deb" if DEBIAN.search(name) else "pypi")
    finally:
        docker("rm", container)


def _package(record: str, kind: str) -> Iterator[PackageURL]:
    said = Parser().parsestr(record, headersonly=True)
    if kind == "pypi":
        name = re.sub(r"[-_.]+", "-", said["Name"]).lower()
        yield PackageURL("pypi", None, name, said["Version"])
    elif said["Status"] is None or said["Status"].endswith(" installed"):
        qualifiers = {"arch": said["Architecture"]}
        yield PackageURL("deb", "debian", said["Package"], said["Version"], qualifiers)


def bill(image: str, digest: str) -> str:
    """What is in an image, as CycloneDX."""
    made = Bom()
    name, _, version = image.partition(":")
    made.metadata.component = Component(
        name=name,
        version=version,
        type=ComponentType.CONTAINER,
        purl=PackageURL("oci", None, name.split("/")[1], f"sha256:{digest}"),
    )
    found = list(packages(image))
    if name.endswith("/proxy"):
        caddy = docker("run", "--rm", "--entrypoint", "caddy", image, "version").split()[0]
        found.append(PackageURL("golang", "github.com/caddyserver/caddy", "v2", caddy))
    for url in found:
        made.components.add(
            Component(
                name=url.name,
                version=url.version,
                type=ComponentType.LIBRARY,
                purl=url,
                bom_ref=url.to_string(),
            )
        )
    return JsonV1Dot6(made).output_as_string(indent=2)


def provenance(image: str, digest: str, commit: str, times: tuple[datetime, datetime]) -> str:
    """How an image was made, as SLSA says it."""
    lock = ROOT / "requirements.lock"
    needed: list[dict[str, Any]] = [
        {"uri": f"git+{source()}@{commit}", "digest": {"gitCommit": commit}},
        *({"uri": f"docker:{b}", "digest": {"sha256": digest_of(b)}} for b in bases().values()),
        {
            "uri": f"file:{lock.name}",
            "digest": {"sha256": hashlib.sha256(lock.read_bytes()).hexdigest()},
        },
    ]
    started, finished = (time.isoformat(timespec="seconds") for time in times)
    statement = {
        "_type": "https://in-toto.io/Statement/v1",
        "subject": [{"name": image, "digest": {"sha256": digest}}],
        "predicateType": "https://slsa.dev/provenance/v1",
        "predicate": {
            "buildDefinition": {
                "buildType": f"urn:buildarena:{RECIPE}",
                "externalParameters": {"target": image.split("/")[1].split(":")[0], **bases()},
                "resolvedDependencies": needed,
            },
            "runDetails": {
                "builder": {"id": "urn:buildarena:make-images"},
                "metadata": {"startedOn": started, "finishedOn": finished},
            },
        },
    }
    return json.dumps(statement, indent=2)


def main() -> None:
    out = Path(sys.argv[1])
    changed = said("git", "status", "--porcelain")
    if changed:
        sys.exit(f"images are built from what is committed; there are changes:\n{changed}")
    commit = said("git", "rev-parse", "HEAD")
    out.mkdir(parents=True, exist_ok=True)
    for target in TARGETS:
        started = datetime.now(UTC)
        image = build(target, commit)
        finished = datetime.now(UTC)
        digest = docker("image", "inspect", "--format", "{{.Id}}", image).partition(":")[2]
        (out / f"{target}.cdx.json").write_text(bill(image, digest))
        made = provenance(image, digest, commit, (started, finished))
        (out / f"{target}.provenance.json").write_text(made)
        size = int(docker("image", "inspect", "--format", "{{.Size}}", image))
        print(f"{image}  {size / 1e6:.0f} MB  sha256:{digest[:12]}", flush=True)
    print(f"{out}: a bill of materials and a statement of provenance for each")


main()
