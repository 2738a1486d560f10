"""Measures the dashboard in a browser that draws in software, and prints the figures as JSON.

Run by `make bench-web`. A machine of 135 blocks and its trial, a transcript of 300 turns, the first
page, and the board of 3,000 jobs on a processor four times as slow; each beside its bar. Frames are
those the page gets done, on however busy a machine.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import httpx
from benchmarks.scale.filling import TRACKS, Amount, fill
from support.machines.families import lattice
from support.servers.stacks import running_stack, wait_until

from buildarena_cli.local.postgres import url_of_running
from buildarena_store import Database

ROOT = Path(__file__).parents[2]

BARS = {
    "fps_machine_135_blocks": ("least", 15),
    "fps_trial_135_blocks": ("least", 15),
    "worst_frame_ms_scrolling_300_turns": ("most", 50),
    "interactive_ms_first_page": ("most", 500),
    "script_kb_first_page": ("most", 350),
    "longest_task_ms_board_4x": ("most", 200),
    "longest_task_ms_board_figures_4x": ("most", 200),
    "longest_task_ms_board_scope_4x": ("most", 200),
}
BOARD = Amount(ended=2 * 3_000, queued=0, models=20)
"""3,000 jobs on each of its two tracks."""
TURNS = 300


def main() -> int:
    """Measures, prints, and returns 1 if a bar is missed."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        with running_stack(place) as stack:
            with httpx.Client(base_url=stack.url, timeout=30) as client:
                large, long = _large_machine(client), _many_turns(client)
            figures = _measured(stack.url, place / "figures.json", large, long)
            _fill(place / "data" / "postgres")
            figures |= _measured(stack.url, place / "board.json", board=TRACKS[0])
    report = {
        name: {"value": round(figures[name], 1), kind: bar}
        for name, (kind, bar) in BARS.items()
        if name in figures
    }
    sys.stdout.write(json.dumps(report, indent=1) + "\n")
    kept = all(
        name in figures and (figures[name] >= bar if kind == "least" else figures[name] <= bar)
        for name, (kind, bar) in BARS.items()
    )
    return 0 if kept else 1


def _fill(postgres: Path) -> None:
    url = url_of_running(postgres)
    assert url is not None, "the stack has a database of its own"
    database = Database(url)
    fill(database, BOARD)
    database.close()


def _session(client: httpx.Client, agent: str) -> str:
    body = {"task": "support-1", "agent": agent, "simulator": "mujoco"}
    return str(client.post("/v1/sessions", json=body).raise_for_status().json()["id"])


def _call(client: httpx.Client, session: str, tool: str, arguments: object) -> None:
    body = {"tool": tool, "arguments": arguments}
    client.post(f"/v1/sessions/{session}/calls", json=body).raise_for_status()


def _large_machine(client: httpx.Client) -> str:
    session = _session(client, "lattice")
    for record in lattice(9, 15, 30).log:
        _call(client, session, record.name, dict(record.arguments))
    client.post(f"/v1/sessions/{session}/submit").raise_for_status()
    wait_until(
        lambda: client.get(f"/v1/jobs/{session}").json()["state"] == "done", 120, "the trial"
    )
    return session


def _many_turns(client: httpx.Client) -> str:
    session = _session(client, "talker")
    _call(client, session, "start", {})
    for turn in range(1, TURNS):
        tool, of = (
            ("get_machine_summary", {}) if turn % 3 else ("get_block_details", {"block_id": "1"})
        )
        _call(client, session, tool, of)
    return session


def _measured(url: str, file: Path, *jobs: str, board: str = "") -> dict[str, float]:
    command = ["bash", "mk/node.sh", "npm", "--prefix", "clients/web", "run", "--silent"]
    done = subprocess.run(
        [*command, "test:pages", "--", "e2e/bench.test.ts"],
        cwd=ROOT,
        env={
            **os.environ,
            "BUILDARENA_WEB_URL": url,
            "BUILDARENA_WEB_BENCH": ",".join((str(file), *jobs)),
            "BUILDARENA_WEB_BOARD": board,
        },
        capture_output=True,
        text=True,
        timeout=400,
        check=False,
    )
    if done.returncode:
        sys.stderr.write(done.stdout[-4000:] + done.stderr[-2000:])
    figures: dict[str, float] = json.loads(file.read_text()) if file.exists() else {}
    return figures


if __name__ == "__main__":
    sys.exit(main())
