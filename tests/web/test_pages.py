"""The dashboard in a real browser, against the whole service."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import httpx
import pytest
from pydantic import SecretStr
from running import finished, running_stack

from buildarena_api.dashboard.files import FOLDER

WEB = Path(__file__).resolve().parents[2] / "clients" / "web"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
NODE = WEB.parents[1] / "mk" / "node.sh"
SWEEP = {
    "name": "pages",
    "tasks": ["support-1"],
    "models": ["builtin/expert", "builtin/idle"],
    "seeds": [0],
    "simulator": "mujoco",
}
ADMIN = "operator-secret-that-is-long-enough"
BUILDARENA = str(Path(sys.executable).with_name("buildarena"))
LONGEST_S = 420

pytestmark = [
    pytest.mark.skipif(
        "BUILDARENA_TEST_WEB" not in os.environ, reason="two minutes in a browser: make test-web"
    ),
    pytest.mark.skipif(
        CHROMIUM is None, reason="pages need a browser: install the Debian packages chromium"
    ),
    pytest.mark.skipif(
        not (FOLDER / "index.html").is_file() or not (WEB / "node_modules").is_dir(),
        reason="the dashboard has not been built: make web",
    ),
    pytest.mark.timeout(LONGEST_S + 120),
]


def test_pages_work_in_a_browser(tmp_path: Path) -> None:
    report = tmp_path / "report.md"
    with running_stack(tmp_path) as stack:
        with httpx.Client(base_url=stack.url) as client:
            sweep_id = client.post("/v1/sweeps", json=SWEEP).raise_for_status().json()["id"]
            finished(client, sweep_id)
        write = [BUILDARENA, "report", sweep_id, "--out", str(report), "--url", stack.url]
        subprocess.run(write, check=True, timeout=60)
        in_browser([], BUILDARENA_WEB_URL=stack.url, BUILDARENA_WEB_REPORT=str(report))


def test_pages_ask_for_a_key_and_offer_what_it_may(tmp_path: Path) -> None:
    with running_stack(tmp_path, require_keys=True, admin_key=SecretStr(ADMIN)) as stack:
        in_browser(
            ["e2e/keys"], BUILDARENA_WEB_GUARDED_URL=stack.url, BUILDARENA_WEB_ADMIN_KEY=ADMIN
        )


def in_browser(files: list[str], **environment: str) -> None:
    """Runs the browser's tests of these files, or all."""
    command = ["bash", str(NODE), "npm", "--prefix", str(WEB), "run", "--silent", "test:pages"]
    done = subprocess.run(
        [*command, "--", *files],
        cwd=NODE.parents[1],
        env={
            **os.environ,
            **environment,
            "BUILDARENA_CHROMIUM": str(CHROMIUM),
            "NO_COLOR": "1",
        },
        capture_output=True,
        text=True,
        timeout=LONGEST_S,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]
