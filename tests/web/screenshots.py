"""Photographs the dashboard: a service of its own, a demo in it, and a browser."""

import argparse
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import httpx

ROOT = Path(__file__).resolve().parents[2]

from support.servers.stacks import finished, running_stack  # noqa: E402 - the folder is no package

IMAGES = ROOT / "docs" / "images"
MAX_BYTES = 300_000
"""Of a picture that the README shows."""
DEMO = [
    {
        "name": "baselines",
        "tasks": ["transport-1", "support-1", "support-2", "lift-1", "lift-2"],
        "models": ["builtin/expert", "builtin/random", "builtin/idle"],
        "samples": 3,
        "simulator": "mujoco",
    },
    {
        "name": "more seeds",
        "tasks": ["support-1", "lift-1"],
        "models": ["builtin/expert", "builtin/random"],
        "seeds": [1, 2, 3, 4],
        "simulator": "mujoco",
        "budget": {"max_requests": 5000},
    },
]


def main() -> None:
    """Photographs what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--all", type=Path, help="every page into this folder, in place of the two")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, running_stack(Path(folder)) as stack:
        with httpx.Client(base_url=stack.url, timeout=60) as client:
            for spec in DEMO:
                sweep = client.post("/v1/sweeps", json=spec).raise_for_status().json()["id"]
                finished(client, sweep, within_s=400)
        photograph(stack.url, given.all or IMAGES, everything=given.all is not None)
    if given.all is None:
        for picture in sorted(IMAGES.glob("*.png")):
            size = picture.stat().st_size
            print(f"{picture.relative_to(ROOT)}: {size // 1000} kB")  # noqa: T201 - its output
            if size > MAX_BYTES:
                raise SystemExit(f"{picture}: larger than {MAX_BYTES // 1000} kB")


def photograph(url: str, folder: Path, *, everything: bool) -> None:
    """Runs the browser."""
    script = ROOT / "clients" / "web" / "scripts" / "screenshots.mjs"
    command = ["bash", str(ROOT / "mk" / "node.sh"), "node", str(script), url, str(folder)]
    subprocess.run(
        command + (["--all"] if everything else []),
        cwd=ROOT,
        check=True,
        env={**os.environ, "BUILDARENA_CHROMIUM": shutil.which("chromium") or "/usr/bin/chromium"},
    )


if __name__ == "__main__":
    main()
