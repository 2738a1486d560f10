"""`make test-image-openenv`: the image of the OpenEnv server, built, run and played with.

The container has no privileges and a file system that it cannot write to; the README's own client
code plays with it, and must print what the README says.
"""

import json
import os
import subprocess
import sys
import time
from contextlib import ExitStack

from scenarios.containers.engine import ROOT, Engine, require_programs, say
from support.documents.code_blocks import shown_in

FOLDER = ROOT / "integrations" / "openenv"
PYTHON = ROOT / ".venv-integrations" / "openenv" / "bin" / "python"
IMAGE, CONTAINER, PORT = "buildarena-openenv:test", "batest-openenv", 18900
CONFINED = (
    *("--read-only", "--tmpfs", "/tmp", "--cap-drop", "ALL"),
    *("--security-opt", "no-new-privileges", "--memory", "1g"),
)
HEALTHY_S = 60


def built(engine: Engine) -> float:
    """Builds the image; its megabytes on the disk."""
    tag, _ = engine.bases()
    engine.run(
        *("build", "--quiet", "--file", str(FOLDER / "Dockerfile"), "--tag", IMAGE),
        *("--build-arg", f"PYTHON_IMAGE=buildarena-base/python:{tag}", str(ROOT)),
        DOCKER_BUILDKIT="1",
    )
    return engine.megabytes(IMAGE)


def started(engine: Engine) -> float:
    """Starts a container; seconds until its own check calls it healthy."""
    began = time.monotonic()
    port = f"127.0.0.1:{PORT}:8000"
    engine.run("run", "--detach", "--name", CONTAINER, "--publish", port, *CONFINED, IMAGE)
    while True:
        state = engine.json("inspect", CONTAINER)[0]["State"]
        if state["Health"]["Status"] == "healthy":
            return time.monotonic() - began
        ended = not state["Running"] or time.monotonic() - began > HEALTHY_S
        assert not ended, engine.run("logs", CONTAINER)[-2000:]
        time.sleep(0.2)


def played() -> str:
    """What the README's client prints when it plays with the container."""
    shown = (block.code for block in shown_in(FOLDER / "README.md"))
    (code,) = (code for code in shown if "BuildClient(base_url" in code)
    done = subprocess.run(
        [str(PYTHON), "-c", code],
        env={**os.environ, "PORT": str(PORT)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def main() -> None:
    """Builds, runs, plays, and takes everything down."""
    require_programs()
    with ExitStack() as stack:
        engine = Engine(stack)
        engine.run("rm", "--force", CONTAINER, check=False)
        stack.callback(engine.run, "rmi", "--force", IMAGE, check=False)
        stack.callback(engine.run, "rm", "--force", CONTAINER, check=False)
        say("-- image")
        figures = {"image_mb": round(built(engine))}
        say("-- container")
        figures["healthy_s"] = round(started(engine), 1)
        say("-- the README's client")
        said = played()
        assert said.strip() in (FOLDER / "README.md").read_text(), said
        user = engine.run("exec", CONTAINER, "id", "-u").strip()
        assert user != "0", "the server runs as root"
        engine.run("stop", "--time", "10", CONTAINER)
        code = engine.json("inspect", CONTAINER)[0]["State"]["ExitCode"]
        assert code == 0, f"the server ended with {code} when it was asked to stop"
    sys.stdout.write(json.dumps(figures) + "\n")


if __name__ == "__main__":
    main()
