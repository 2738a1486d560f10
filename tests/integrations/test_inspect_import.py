"""Logs of Inspect in the service: their calls are made again, and the service judges."""

import os
import re
import shutil
import subprocess
import time
from pathlib import Path

import httpx
import pytest
from support.programs import captured
from support.servers.live_api import live_api
from support.stages import work

from buildarena_simulation import DEFAULT_ENGINE

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.ci
ADAPTER = ROOT / "integrations/inspect"
PYTHON = ROOT / ".venv-integrations/inspect/bin/python"


@pytest.fixture(scope="module")
def logs(tmp_path_factory) -> Path:
    """A log of the adapter's real environment, and the same with made-up scores."""
    if not PYTHON.exists():
        if os.environ.get("CI"):
            pytest.fail("the environment of integrations/inspect is not there: make check")
        pytest.skip("the environment of integrations/inspect is not there: make check")
    folder = tmp_path_factory.mktemp("logs")
    words = [PYTHON, ADAPTER / "tests/write_logs.py", folder]
    subprocess.run(words, check=True, cwd=folder, timeout=200)
    return folder


def bring(url: str, *words: object, key: str = "") -> tuple[int, list[str]]:
    """Runs the import; its exit code and lines."""
    done = captured(
        [PYTHON, "-m", "buildarena_inspect", "import", *map(str, words), "--url", url],
        env={**os.environ, "BUILDARENA_KEY": key},
        within_s=200,
    )
    return done.returncode, [*done.stdout.splitlines(), *done.stderr.splitlines()]


def jobs_of(client: httpx.Client) -> dict[str, dict]:
    return {job["task"]: job for job in client.get("/v1/jobs").json()["data"]}


def test_a_log_becomes_jobs_that_the_service_itself_tries_and_scores(
    logs, context, tmp_path
) -> None:
    with live_api(context) as url, httpx.Client(base_url=url) as client:
        code, first = bring(url, logs / "honest.eval", "--wait", 0)
        assert code == 1, first
        assert first[0] == "honest.eval: 4 of 4 samples"
        assert sum("has not ended yet" in line for line in first) == 2
        work(context)
        # A shard of the log lies below it: its samples are the log's.
        shard = tmp_path / "honest.shards" / "0" / "shard.eval"
        shard.parent.mkdir(parents=True)
        for copy in (tmp_path / "honest.eval", shard):
            shutil.copy(logs / "honest.eval", copy)
        code, second = bring(url, tmp_path)
        assert second.pop() == "shard.eval: 4 of 4 samples"
        assert (code, len(second)) == (0, 5), second
        assert all("by agent/inspect-mockllm-model, imported before" in line for line in second[1:])
        told = [[re.findall(r"job_\w+", line) for line in lines] for lines in (first, second)]
        assert told[0] == told[1]
        jobs = jobs_of(client)
        assert len(jobs) == 4
        begin = f"external+data-sheets/{DEFAULT_ENGINE}-"
        assert all(job["track"].startswith(begin) for job in jobs.values())
        assert [jobs[name]["outcome"] for name in ("support-1", "support-3")] == ["success"] * 2
        for name in ("lift-2", "support-2"):
            assert jobs[name]["outcome"] == "construction_failed"
            assert jobs[name]["reason"] == "empty_machine"
        code, lying = bring(url, logs / "lying.eval")
        assert code == 1
        carried = f"{jobs['support-1']['indicator']:.6g}"
        assert f"  indicator: 999 in the log, {carried} in the service" in lying
        assert "  success: True in the log, False in the service" in lying
        assert jobs_of(client) == jobs


@pytest.mark.nightly
def test_an_import_that_was_broken_off_goes_on_where_it_stopped(logs, context) -> None:
    with live_api(context) as url, httpx.Client(base_url=url) as client:
        command = [PYTHON, "-m", "buildarena_inspect", "import", logs / "honest.eval"]
        with subprocess.Popen([*command, "--url", url, "--wait", "0"]) as broken:
            until = time.monotonic() + 60
            while jobs_of(client).get("support-3", {}).get("actions", 0) < 5:
                assert time.monotonic() < until
                time.sleep(0.02)
            broken.kill()
        half = jobs_of(client)["support-3"]
        bring(url, logs / "honest.eval", "--wait", 0)
        whole = jobs_of(client)["support-3"]
        assert whole["id"] == half["id"]
        turns = client.get(f"/v1/jobs/{whole['id']}/transcript").json()["turns"]
        assert len(turns) == whole["actions"] == 61
