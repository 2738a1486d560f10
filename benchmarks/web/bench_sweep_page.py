"""How usable a sweep's page is at 10,000 jobs while they end: load, long tasks, clicks, memory."""

import argparse
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import httpx
from benchmarks.figures import tell
from support.servers.stacks import running_stack

ROOT = Path(__file__).resolve().parents[2]

TASKS = ["support-1", "support-2", "support-3", "lift-1", "lift-2"]
MEASURE = ROOT / "clients" / "web" / "scripts" / "measure-sweep.mjs"


def main() -> None:
    """Measures and prints JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=10_000)
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--json", type=Path, help="also write the figures here")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, running_stack(Path(folder), lease_s=30.0) as up:
        figures = measured(up.url, given.jobs, given.seconds)
    tell(figures, given.json)


def measured(url: str, jobs: int, seconds: int) -> dict[str, Any]:
    """Opens the page while the service's own workers end the sweep's jobs."""
    spec = {
        "name": "large",
        "tasks": TASKS,
        "models": ["builtin/idle"],
        "samples": jobs // len(TASKS),
        "simulator": "mujoco",
    }
    with httpx.Client(base_url=url, timeout=120) as client:
        sweep_id = client.post("/v1/sweeps", json=spec).raise_for_status().json()["id"]

        def ended() -> int:
            return int(client.get(f"/v1/sweeps/{sweep_id}").json()["progress"]["done"])

        before = ended()
        done = subprocess.run(
            [
                "bash",
                str(ROOT / "mk" / "node.sh"),
                "node",
                str(MEASURE),
                url,
                sweep_id,
                f"{seconds}",
            ],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, "BUILDARENA_CHROMIUM": shutil.which("chromium") or ""},
        )
        if done.returncode != 0:
            raise SystemExit(done.stderr)
        return {"jobs": jobs, "ended_meanwhile": ended() - before, **json.loads(done.stdout)}


if __name__ == "__main__":
    main()
