"""The Docker engine and Compose, as commands; and everything they made, gone at the end."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
TARGETS = ("api", "construct", "simulate-pybullet", "simulate-mujoco", "tools", "proxy")
BASES = ("python", "postgres", "valkey", "caddy", "s3")
KEPT = "12GB"
"""Of what an engine of our own has built, how much stays for the next run."""
NEEDED = {
    "docker": "docker.io",
    "docker-compose": "docker-compose",
    "debootstrap": "debootstrap",
    "iptables": "iptables",
}


def say(line: str) -> None:
    print(f"[{time.strftime('%H:%M:%S')}] {line}", flush=True)


def require_programs() -> None:
    """Stops with what to install, when something is missing."""
    had = {"docker-compose"} if _composer()[0] == "docker" else set()
    missing = sorted({p for name, p in NEEDED.items() if shutil.which(name) is None} - had)
    if os.geteuid() != 0:
        sys.exit("it needs root: it runs a Docker engine and makes base images")
    if missing:
        sys.exit(f"it needs Debian's packages: apt-get install {' '.join(missing)}")


class Engine:
    """Docker: the engine that runs, or one of our own for as long as this is open."""

    def __init__(self, stack: ExitStack) -> None:
        self.docker = _client()
        self.composer = _composer()
        if self._answers():
            return
        folder = Path(tempfile.mkdtemp(prefix="buildarena-docker-"))
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        # What it has built stays for the next run: base images, and steps that are the same.
        data = ROOT / ".buildarena" / "docker"
        log = (folder / "dockerd.log").open("wb")
        stack.callback(log.close)
        words = ["dockerd", "--data-root", str(data), "--exec-root", str(folder / "run")]
        process = subprocess.Popen(
            [*words, "--pidfile", str(folder / "pid")], stdout=log, stderr=log
        )
        stack.callback(process.wait)
        stack.callback(process.terminate)
        deadline = time.monotonic() + 60
        while not self._answers():
            if process.poll() is not None or time.monotonic() > deadline:
                said = (folder / "dockerd.log").read_text()[-2000:]
                sys.exit(f"the Docker engine did not start:\n{said}")
            time.sleep(0.5)
        stack.callback(self.run, "builder", "prune", "--force", "--keep-storage", KEPT)
        say("started a Docker engine of our own")

    def run(self, *words: str, check: bool = True, **environment: str) -> str:
        """The standard output of a docker command."""
        return command([self.docker, *words], check=check, **environment)

    def json(self, *words: str) -> Any:
        return json.loads(self.run(*words))

    def _answers(self) -> bool:
        done = subprocess.run([self.docker, "info"], capture_output=True, check=False)
        return done.returncode == 0 and b"Server Version" in done.stdout

    def bases(self) -> tuple[str, bool]:
        """The tag of the base images, made where they are not there yet, and whether they were.

        It comes from what they are made of; those of other tags go.
        """
        folder = ROOT / "scenarios" / "containers" / "bases"
        made_of = [*sorted(folder.iterdir()), Path("/etc/ssl/certs/ca-certificates.crt")]
        content = b"".join(file.read_bytes() for file in made_of)
        tag = hashlib.sha256(content).hexdigest()[:12]
        listed = self.run("images", "--format", "{{.Repository}}:{{.Tag}}").split()
        wanted = {f"buildarena-base/{base}:{tag}" for base in BASES}
        there = wanted <= set(listed)
        if not there:
            command(["bash", str(folder / "make.sh"), tag], DOCKER=self.docker)
        old = {name for name in listed if name.startswith("buildarena-base/")} - wanted
        if old:
            self.run("rmi", "--force", *sorted(old), check=False)
        return tag, there

    def build(self, source: Path, version: str, tag: str) -> dict[str, float]:
        """Builds every image of a source tree; seconds by target."""
        took = {}
        for target in TARGETS:
            began = time.monotonic()
            self.run(
                *("build", "--quiet", "--file", str(source / "deploy/docker/Dockerfile")),
                *("--build-arg", f"PYTHON_IMAGE=buildarena-base/python:{tag}"),
                *("--build-arg", f"CADDY_IMAGE=buildarena-base/caddy:{tag}"),
                *("--target", target, "--tag", f"buildarena/{target}:{version}", str(source)),
                DOCKER_BUILDKIT="1",
            )
            took[target] = time.monotonic() - began
        return took

    def megabytes(self, *images: str) -> float:
        """What images take on the disk, with layers that they share counted once."""
        layers: dict[tuple[str, ...], int] = {}
        for image in images:
            words = ("--no-trunc", "--human=false", "--format", "{{.Size}} {{.CreatedBy}}")
            lines = self.run("history", *words, image).splitlines()[::-1]
            for i, line in enumerate(lines):
                layers[tuple(lines[: i + 1])] = int(line.split()[0])
        return sum(layers.values()) / 1e6


class Project:
    """One compose project: its containers, volumes and networks."""

    def __init__(self, engine: Engine, name: str, environment: Mapping[str, str]) -> None:
        self.engine, self.name, self.environment = engine, name, dict(environment)

    def compose(self, *words: str, check: bool = True, **environment: str) -> str:
        return command(
            [*self.engine.composer, "--project-name", self.name, *words],
            check=check,
            **{**self.environment, **environment},
        )

    def scale(self, containers: Mapping[str, int]) -> None:
        """Brings up or takes down containers of services until there are so many of each."""
        numbers = [f"--scale={service}={number}" for service, number in containers.items()]
        self.compose("up", "--detach", "--no-build", "--no-recreate", *numbers)

    def containers(self, service: str | None = None, *, running: bool = True) -> list[str]:
        filters = ["--filter", f"label=com.docker.compose.project={self.name}"]
        if service:
            filters += ["--filter", f"label=com.docker.compose.service={service}"]
        listed = self.engine.run("ps", "--quiet", *([] if running else ["--all"]), *filters)
        return listed.split()

    def wait_healthy(self, services: Sequence[str], within_s: float = 120) -> None:
        deadline = time.monotonic() + within_s
        while True:
            states = {service: self._states(service) for service in services}
            if all(found and set(found) <= {"healthy", "running"} for found in states.values()):
                return
            assert time.monotonic() < deadline, f"not healthy within {within_s} s: {states}"
            time.sleep(0.5)

    def _states(self, service: str) -> list[str]:
        found = []
        for container in self.containers(service):
            state = self.engine.json("inspect", container)[0]["State"]
            found.append(state["Health"]["Status"] if "Health" in state else state["Status"])
        return found

    def destroy(self) -> None:
        self.compose(
            *("--profile", "s3", "--profile", "monitoring", "--profile", "tools"),
            *("down", "--volumes", "--remove-orphans", "--timeout", "10"),
            check=False,
        )

    def left(self) -> list[str]:
        """What is still there of it."""
        label = f"label=com.docker.compose.project={self.name}"
        kinds = (("ps", "--all"), ("volume", "ls"), ("network", "ls"))
        return [
            thing
            for kind in kinds
            for thing in self.engine.run(*kind, "--quiet", "--filter", label).split()
        ]


def _client() -> str:
    """A client that builds with BuildKit: newer ones need a plugin, Debian's has it inside."""
    plugin = subprocess.run(["docker", "buildx", "version"], capture_output=True, check=False)
    old = Path("/usr/bin/docker")
    return str(old) if plugin.returncode and old.exists() else "docker"


def _composer() -> list[str]:
    """Compose 2 where Docker's client has it, or 1, which Debian has."""
    plugin = subprocess.run(["docker", "compose", "version"], capture_output=True, check=False)
    return ["docker-compose"] if plugin.returncode else ["docker", "compose"]


def command(words: Sequence[str], *, check: bool = True, **environment: str) -> str:
    done = subprocess.run(
        list(words),
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    if check and done.returncode:
        raise RuntimeError(f"{' '.join(words)}\n{done.stdout[-3000:]}\n{done.stderr[-5000:]}")
    return done.stdout
