"""The job's page against what really happens: random machines, live sessions, processes killed."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import httpx
import psutil
from running import finished, running_stack
from tests.web import test_pages
from tests.web.random_machines import built_session
from tests.web.test_pages import CHROMIUM, LONGEST_S, NODE, WEB

pytestmark = test_pages.pytestmark

MACHINES, A_SESSION = 50, 10
SWEEP = {
    "name": "room",
    "tasks": ["support-1"],
    "models": ["builtin/expert"],
    "seeds": [0, 1],
    "simulator": "mujoco",
}


def processes(*names: str) -> list[int]:
    """The service's processes with one of these words among theirs."""
    found = []
    for process in psutil.Process().children(recursive=True):
        words = process.cmdline()
        if any(any(name in word for word in words) for name in names):
            found.append(process.pid)
    return found


def test_the_room_of_a_job_shows_what_is(tmp_path: Path) -> None:
    with running_stack(tmp_path) as stack:
        with httpx.Client(base_url=stack.url, timeout=30) as client:
            sweep = client.post("/v1/sweeps", json=SWEEP).raise_for_status().json()["id"]
            groups = [range(k, k + A_SESSION) for k in range(0, MACHINES, A_SESSION)]
            sessions = [built_session(client, f"random-{g[0]}", g) for g in groups]
            finished(client, sweep)
        tried = [step for session in sessions for step in session["steps"] if step["ghosts"]]
        assert tried
        file = tmp_path / "machines.json"
        file.write_text(json.dumps(sessions))
        killed = processes("buildarena_api", "buildarena_worker")
        assert killed
        command = ["bash", str(NODE), "npm", "--prefix", str(WEB), "run", "--silent", "test:pages"]
        done = subprocess.run(
            [*command, "--", "e2e/room.test.ts", "--disable-console-intercept"],
            cwd=NODE.parents[1],
            env={
                **os.environ,
                "BUILDARENA_WEB_URL": stack.url,
                "BUILDARENA_CHROMIUM": str(CHROMIUM),
                "BUILDARENA_WEB_MACHINES": str(file),
                "BUILDARENA_WEB_KILL": ",".join(map(str, killed)),
                "NO_COLOR": "1",
            },
            capture_output=True,
            text=True,
            timeout=LONGEST_S,
            check=False,
        )
    print(done.stdout[-3000:])  # noqa: T201 - the measured figures, for who asks with -s
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]
