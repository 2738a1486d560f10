"""What containers may do, and where no secret may stand."""

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from scenarios.containers.engine import ROOT, TARGETS, Engine, Project
from scenarios.containers.service import Service

SHORT = 12
"""Secrets that are shorter could stand somewhere by chance."""
OURS_THERE = """
import hashlib, json, sysconfig
from pathlib import Path
site = Path(sysconfig.get_path("purelib"))
digest = lambda file: hashlib.sha256(file.read_bytes()).hexdigest()
files = site.glob("buildarena*/**/*.py")
print(json.dumps({str(file.relative_to(site)): digest(file) for file in files}))
"""
"""What an image's Python is asked: digests of our sources in it."""


def check_code(engine: Engine) -> dict[str, int]:
    """Each image has our sources as they stand in the tree; how many files of them, by image."""
    ours = {
        str(Path(folder, name).relative_to(source)): _digest(Path(folder, name))
        for room in ("libs", "services", "clients")
        for source in (ROOT / room).glob("*/src")
        # The backend's migrations are a link to those at the top.
        for folder, _, names in os.walk(source, followlinks=True)
        for name in names
        if name.endswith(".py")
    }
    found = {}
    for target in (target for target in TARGETS if target != "proxy"):
        words = ("run", "--rm", "--entrypoint", "python", f"buildarena/{target}:current")
        there = json.loads(engine.run(*words, "-c", OURS_THERE))
        other = sorted(name for name, digest in there.items() if ours.get(name) != digest)
        assert not other, f"{target} has other sources than the tree: {', '.join(other)}"
        assert {name.partition("/")[0] for name in there} >= {"buildarena_backend"}, target
        found[target] = len(there)
    return found


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def check_confinement(project: Project, services: Sequence[str]) -> dict[str, str]:
    """Every container runs as an ordinary user, with a read-only root and no capability."""
    found = {}
    for name in services:
        container = project.containers(name)[0]
        config: dict[str, Any] = project.engine.json("inspect", container)[0]
        host = config["HostConfig"]
        assert host["ReadonlyRootfs"], name
        assert host["CapDrop"] == ["ALL"], (name, host["CapDrop"])
        assert not host["CapAdd"], (name, host["CapAdd"])
        assert not host["Privileged"], name
        assert "no-new-privileges:true" in host["SecurityOpt"], name
        # As this machine sees it: an image of one program has nothing to look with.
        process = Path("/proc", str(config["State"]["Pid"]))
        status = (process / "status").read_text()
        facts = dict(line.split(":\t", 1) for line in status.splitlines() if ":\t" in line)
        assert set(facts["Uid"].split()) == {facts["Uid"].split()[0]} != {"0"}, (name, facts["Uid"])
        assert int(facts["CapEff"], 16) == int(facts["CapBnd"], 16) == 0, (name, facts["CapEff"])
        mounts = [line.split() for line in (process / "mountinfo").read_text().splitlines()]
        (root,) = (mount[5] for mount in mounts if mount[4] == "/")
        assert "ro" in root.split(","), (name, root)
        found[name] = f"uid {facts['Uid'].split()[0]}, no capabilities, read-only root"
    return found


def check_no_secrets(project: Project, secrets: Mapping[str, str], service: Service) -> None:
    """No secret stands in an image, a container's environment or command, a log or an answer."""
    values = {name: text.strip() for name, text in secrets.items() if len(text.strip()) >= SHORT}
    engine = project.engine
    places = {
        f"image {target}": engine.run("history", "--no-trunc", f"buildarena/{target}:current")
        + engine.run("image", "inspect", f"buildarena/{target}:current")
        for target in TARGETS
    }
    for container in project.containers(running=False):
        places[f"container {container}"] = engine.run("inspect", container)
        places[f"processes of {container}"] = engine.run(
            "top", container, "-eo", "args", check=False
        )
    places["logs"] = project.compose("logs", "--no-color")
    for path in ("/v1/health", "/v1/metrics", "/v1/models", "/v1/tasks"):
        places[path] = service.ask("GET", path).text
    assert "GET" in places["logs"] or "stage_done" in places["logs"], "there are no logs to look at"
    for place, text in places.items():
        for name, value in values.items():
            assert value not in text, f"the secret {name} stands in {place}"
