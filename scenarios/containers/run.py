"""`make scenario NAME=containers`: our images and compose file, used as an operator uses them.

Builds the images of this tree and of the commit before; brings the older ones up; runs 200 jobs
through HTTPS while workers are scaled, containers killed and the database restarted; upgrades under
a running sweep; backs up, destroys, restores into another project whose artifacts lie in S3;
verifies every job there. At the end nothing is left.
"""

import argparse
import json
import random
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import httpx
from scenarios.containers.engine import (
    ROOT,
    TARGETS,
    Engine,
    Project,
    command,
    require_programs,
    say,
)
from scenarios.containers.inspecting import check_code, check_confinement, check_no_secrets
from scenarios.containers.service import Service
from support.documents.code_blocks import shown_in

SWEEP = {
    "name": "containers",
    "tasks": ["support-1", "transport-1", "lift-1", "support-2", "lift-2"],
    "models": ["builtin/expert", "builtin/idle"],
    "samples": 20,
    "simulator": "mujoco",
    "worlds": 0,
}
"""One trial a job; the smaller sweep has those in varied worlds too."""
SMALL = {
    **SWEEP,
    "name": "upgrade",
    "tasks": ["support-3", "transport-2"],
    "samples": 4,
    "worlds": 4,
}
PORTS = {"first": (18443, 18080), "second": (19443, 19080)}
BACKUPS = "batest-backups"
"""The volume that outlives the projects."""
LARGEST_MB = {"service": 1350, "proxy": 320}
"""What the images may take; those of services are the same files. The proxy is small where its base
is: here it is Debian with Caddy."""
LONG_RUNNING = (
    "postgres",
    "valkey",
    "api",
    "construct",
    "simulate-pybullet",
    "simulate-mujoco",
    "proxy",
)


class Run:
    """What the steps share, and what they measured."""

    def __init__(self, stack: ExitStack, *, keep: bool) -> None:
        self.stack, self.keep = stack, keep
        self.engine = Engine(stack)
        self.folder = Path(tempfile.mkdtemp(prefix="buildarena-containers-"))
        self.folder.chmod(0o711)
        stack.callback(subprocess.run, ["git", "worktree", "prune"], cwd=ROOT, check=False)
        stack.callback(shutil.rmtree, self.folder, ignore_errors=True)
        self.figures: dict[str, Any] = {}
        self.tag = ""
        self.random = random.Random(18)

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        say(f"-- {name}")
        began = time.monotonic()
        yield
        self.figures.setdefault("seconds", {})[name] = round(time.monotonic() - began, 1)
        say(f"   {time.monotonic() - began:.1f} s")

    def project(self, name: str, version: str, **environment: str) -> Project:
        https, http = PORTS[name]
        secrets = self.folder / name
        command(["bash", "deploy/docker/make-secrets.sh", str(secrets / "secrets")])
        # Compose reads secrets beside its file, so each project has a copy of the file.
        for file in ("docker-compose.yml", "deploy"):
            (secrets / file).symlink_to(ROOT / file)
        project = Project(
            self.engine,
            f"batest{name}",
            {
                "COMPOSE_FILE": str(secrets / "docker-compose.yml"),
                "BUILDARENA_VERSION": version,
                "BUILDARENA_HTTPS_PORT": str(https),
                "BUILDARENA_HTTP_PORT": str(http),
                "BUILDARENA_BACKUPS": BACKUPS,
                "POSTGRES_IMAGE": f"buildarena-base/postgres:{self.tag}",
                "VALKEY_IMAGE": f"buildarena-base/valkey:{self.tag}",
                "CADDY_IMAGE": f"buildarena-base/caddy:{self.tag}",
                "PYTHON_IMAGE": f"buildarena-base/python:{self.tag}",
                "S3_IMAGE": f"buildarena-base/s3:{self.tag}",
                **environment,
            },
        )
        project.destroy()  # what a run that was killed has left
        self.stack.callback(project.destroy)
        return project

    def secrets_of(self, name: str) -> dict[str, str]:
        folder = self.folder / name / "secrets"
        return {file.name: file.read_text() for file in sorted(folder.iterdir())}


def build(run: Run) -> None:
    with run.step("base images"):
        run.tag, there = run.engine.bases()
        run.figures["base images were there"] = there
    previous = run.folder / "previous"
    with run.step("images of the commit before"):
        subprocess.run(
            ["git", "worktree", "add", "--quiet", "--detach", str(previous), "HEAD~1"],
            cwd=ROOT,
            check=True,
        )
        run.figures["build_s of the commit before"] = run.engine.build(
            previous, "previous", run.tag
        )
    with run.step("images of this commit"):
        run.figures["build_s"] = run.engine.build(ROOT, "current", run.tag)
    run.figures["our files"] = check_code(run.engine)
    versions = ("previous", "current")
    if not run.keep:
        names = [f"buildarena/{target}:{version}" for target in TARGETS for version in versions]
        run.stack.callback(run.engine.run, "rmi", "--force", *names, check=False)
    services = [f"buildarena/{target}:current" for target in TARGETS if target != "proxy"]
    sizes = {
        "service": round(run.engine.megabytes(*services)),
        "proxy": round(run.engine.megabytes("buildarena/proxy:current")),
    }
    run.figures["image_mb"] = sizes
    assert not {n: mb for n, mb in sizes.items() if mb > LARGEST_MB[n]}, sizes


def first_job(run: Run) -> tuple[Project, Service]:
    project = run.project("first", "previous")
    run.engine.run("volume", "rm", "--force", BACKUPS)
    run.engine.run("volume", "create", BACKUPS)
    run.stack.callback(run.engine.run, "volume", "rm", "--force", BACKUPS, check=False)
    with run.step("up to the first job's end"):
        began = time.monotonic()
        project.compose("up", "--detach", "--no-build")
        started = time.monotonic() - began
        key = run.secrets_of("first")["admin_key"]
        service = Service(project, PORTS["first"][0], key, run.folder)
        service.wait_up()
        ready = time.monotonic() - began
        sweep = service.submit(
            {
                **SWEEP,
                "name": "one",
                "tasks": ["support-1"],
                "models": ["builtin/expert"],
                "samples": 1,
            }
        )
        service.wait_ended(sweep)
        run.figures["start_s"] = {
            "compose up returned": round(started, 1),
            "everything healthy": round(ready, 1),
            "first job done": round(time.monotonic() - began, 1),
        }
        project.wait_healthy(LONG_RUNNING)
    return project, service


def look_from_outside(run: Run, service: Service) -> None:
    with run.step("TLS, keys, the command line"):
        bare = httpx.Client(
            base_url=service.url, verify=service.client._transport._pool._ssl_context
        )
        assert bare.get("/v1/sweeps").status_code == 401
        assert bare.get("/v1/sweeps", headers={"Authorization": "Bearer wrong"}).status_code == 401
        plain = httpx.get(f"http://localhost:{PORTS['first'][1]}/v1/health")
        assert plain.status_code in {301, 308}, plain
        assert plain.headers["location"].startswith("https://")
        page = service.ask("GET", "/", headers={"Accept": "text/html"})
        assert "<!doctype html>" in page.text.lower()
        assert "strict-transport-security" in page.headers
        made = command(
            [
                str(Path(sys.executable).with_name("buildarena")),
                "leaderboard",
                "--url",
                service.url,
                "--json",
            ],
            BUILDARENA_KEY=service.key,
            SSL_CERT_FILE=str(service.authority),
        )
        assert "builtin/expert" in made


def disturb(run: Run, project: Project, service: Service) -> str:
    """200 jobs while workers come and go, containers are killed and the database restarts."""
    with run.step("200 jobs, scaled and killed"):
        sweep = service.submit(SWEEP)
        project.scale({"simulate-mujoco": 3, "construct": 2})
        done = [service.ended(sweep)]
        for share, service_name in (
            (0.1, "simulate-mujoco"),
            (0.2, "construct"),
            (0.3, "api"),
            (0.4, "simulate-mujoco"),
        ):
            service.wait_ended(sweep, share)
            victim = run.random.choice(project.containers(service_name))
            run.engine.run("kill", "--signal", "KILL", victim)
            run.engine.run("start", victim)  # as a supervisor would; `kill` counts as wanted
            done.append(service.ended(sweep))
        service.wait_ended(sweep, 0.5)
        project.compose("restart", "--timeout", "5", "postgres")
        service.wait_ended(sweep, 0.6)
        project.compose("restart", "--timeout", "5", "valkey")
        project.scale({"simulate-mujoco": 1, "construct": 1})
        service.wait_ended(sweep)
        outcomes = service.outcomes(sweep)
        assert sum(outcomes.values()) == 200, outcomes
        assert outcomes["success"] == 100, outcomes
        assert not {"errored", "cancelled", "None"} & set(outcomes), outcomes
        run.figures["outcomes"] = dict(outcomes)
    return sweep


def upgrade(run: Run, project: Project, service: Service) -> str:
    """The newer images take over under a running sweep: migrate, API, then the workers."""
    with run.step("upgrade under a running sweep"):
        sweep = service.submit(SMALL)
        service.wait_ended(sweep, 0.1)
        project.environment["BUILDARENA_VERSION"] = "current"
        project.compose("up", "--detach", "--no-build", "--no-deps", "migrate")
        for name in ("api", "proxy", "construct", "simulate-mujoco", "simulate-pybullet"):
            project.compose("up", "--detach", "--no-build", "--no-deps", name)
        service.wait_ended(sweep)
        outcomes = service.outcomes(sweep)
        assert not {"errored", "cancelled", "None"} & set(outcomes), outcomes
        for name in ("api", "construct"):
            image = run.engine.json("inspect", project.containers(name)[0])[0]["Config"]["Image"]
            assert image.endswith(":current"), image
        plain = httpx.get(f"http://localhost:{PORTS['first'][1]}/v1/health?a=b")
        assert plain.headers["location"] == f"{service.url}/v1/health?a=b", plain.headers
    return sweep


def restore_elsewhere(run: Run, project: Project) -> tuple[Project, Service]:
    """Backup, destruction, and the same service in another project with artifacts in S3."""
    with run.step("backup"):
        said = project.compose("run", "--rm", "tools", "admin", "backup", "/backups", "--json")
        run.figures["backup"] = {
            k: v for k, v in json.loads(said[said.index("{") :]).items() if "artifact" in k
        }
    with run.step("destroy"):
        project.destroy()
        assert not project.left(), project.left()
    other = run.project(
        "second",
        "current",
        BUILDARENA_ARTIFACTS_URL="s3://buildarena",
        BUILDARENA_S3_ENDPOINT="http://s3:9000",
        BUILDARENA_S3_ALLOW_HTTP="true",
        COMPOSE_PROFILES="s3",
    )
    with run.step("restore elsewhere, into S3"):
        # The store first, as the document has it; then its lines, word for word.
        other.compose("up", "--detach", "s3")
        other.wait_healthy(["s3"])
        (shown,) = [
            block.code
            for block in shown_in(ROOT / "docs/deploying.md")
            if "restore /backups" in block.code
        ]
        for line in shown.splitlines():
            docker, compose, *words = shlex.split(line, comments=True)
            assert (docker, compose) == ("docker", "compose"), line
            other.compose(*words)
        key = run.secrets_of("second")["admin_key"]
        service = Service(other, PORTS["second"][0], key, run.folder)
        service.wait_up()
    return other, service


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keep", action="store_true", help="keep the images")
    parser.add_argument("--json", type=Path, help="where figures go")
    words = parser.parse_args()
    require_programs()
    # However it is ended, it takes down what it made; in the background a shell ignores SIGINT.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    with ExitStack() as stack:
        run = Run(stack, keep=words.keep)
        build(run)
        project, service = first_job(run)
        look_from_outside(run, service)
        run.figures["confinement"] = check_confinement(project, LONG_RUNNING)
        sweep = disturb(run, project, service)
        small = upgrade(run, project, service)
        run.figures["memory_mb"] = memory(run, project)
        before = {s: service.jobs(s) for s in (sweep, small)}
        boards = service.get("/v1/leaderboard")
        check_no_secrets(project, run.secrets_of("first"), service)
        project, service = restore_elsewhere(run, project)
        with run.step("the restored service is the same"):
            for one, jobs in before.items():
                assert service.jobs(one) == jobs
            assert service.get("/v1/leaderboard") == boards
        with run.step("verification of all jobs"):
            project.scale({"construct": 2})
            jobs = [
                job["id"]
                for found in before.values()
                for job in found
                if job["success"] is not None
            ]
            verified = service.verify(jobs)
            run.figures["verified"] = {"same": verified[True], "other": verified[False]}
            assert verified == {True: len(jobs)}, verified
        check_no_secrets(project, run.secrets_of("second"), service)
        with run.step("take everything down"):
            project.destroy()
            assert not project.left(), project.left()
    print(json.dumps(run.figures, indent=2))
    if words.json:
        words.json.parent.mkdir(parents=True, exist_ok=True)
        words.json.write_text(json.dumps(run.figures, indent=2))


def memory(run: Run, project: Project) -> dict[str, float]:
    """MiB of each service's first container, as the engine counts them."""
    found = {}
    for name in LONG_RUNNING:
        text = run.engine.run(
            "stats", "--no-stream", "--format", "{{.MemUsage}}", project.containers(name)[0]
        )
        used = text.split("/")[0].strip()
        number = float(used.rstrip("KMGTiB"))
        found[name] = round(number * 1024 if "GiB" in used else number, 1)
    return found


if __name__ == "__main__":
    main()
