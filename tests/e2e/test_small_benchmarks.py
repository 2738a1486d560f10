"""The benchmarks of sessions and jobs in small: that they count what happened, not how fast."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.nightly

ROOT = Path(__file__).parents[2]
TURNS = 38
"""Turns that the expert takes for its average session of support-1, about."""


def test_sessions_are_counted_turn_by_turn(tmp_path) -> None:
    file = tmp_path / "figures.json"
    given = ["--sessions", "3", "--latency", "0.05", "--warm-up", "1", "--json", str(file)]
    subprocess.run(
        [sys.executable, "-m", "benchmarks.sessions", *given],
        check=True,
        timeout=120,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": f"{ROOT}:{ROOT / 'tests'}"},
    )
    figures = json.loads(file.read_text())
    assert figures["sessions"] == 3
    assert 3 * TURNS / 2 < figures["turns"] < 3 * TURNS * 2
    assert 0 < figures["share_of_ideal"] < 1
    assert figures["median_latency_s"] >= 0.05
    assert figures["cpu_ms_per_turn"] > 0
    assert figures["peak_rss_mib"] > 50


def test_what_a_job_costs_is_shared_among_all_processes(monkeypatch) -> None:
    from benchmarks import overhead

    for name, value in {"ALONE": 2, "IDLE_S": 0.2, "POLL_S": 0.1}.items():
        monkeypatch.setattr(overhead, name, value)
    figures = overhead.measure_overhead(10)
    assert figures["jobs"] == 10
    assert figures["session_ms"] > 0
    assert figures["simulation_ms"] > 0
    paid = figures["ms_a_job_by_process"]
    assert {"buildarena_worker", "buildarena_simworker", "postgres"} <= paid.keys()
