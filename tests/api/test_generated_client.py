"""A client that a public generator makes of the contract submits a job."""

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
from support.contract import contract
from support.servers.live_api import live_api

GENERATOR = str(Path(sys.executable).parent / "openapi-python-client")
PROGRAM = """
import sys
sys.path.insert(0, sys.argv[1])
from arena import AuthenticatedClient
from arena.api.jobs import list_jobs, show_job, submit_job
from arena.api.sweeps import show_sweep, submit_sweep
from arena.models import JobSpec, Problem, SweepSpec

with AuthenticatedClient(base_url=sys.argv[2], token=sys.argv[3]) as client:
    job = submit_job.sync(client=client, body=JobSpec(task="lift-1", model="builtin/idle", seed=5))
    assert show_job.sync(job.id, client=client).seed == 5
    assert [found.id for found in list_jobs.sync(client=client).jobs] == [job.id]
    payload = SweepSpec(tasks=["lift-1"], models=["builtin/idle"], seeds=[5, 6])
    sweep = submit_sweep.sync(client=client, body=payload)
    assert (sweep.jobs, sweep.added) == (2, 1)
    assert show_sweep.sync(sweep.id, client=client).progress.total == 2
    wrong = submit_job.sync(client=client, body=JobSpec(task="lift-9", model="builtin/idle"))
    assert isinstance(wrong, Problem), wrong
    assert wrong.errors[0].field == "task"
    print(job.id)
"""


@pytest.mark.ci
def test_a_generated_client_submits_a_job(context, tmp_path) -> None:
    target, document = tmp_path / "arena", tmp_path / "openapi.json"
    document.write_text(json.dumps(contract()))
    words = ["generate", "--path", str(document), "--meta", "none", "--output-path", str(target)]
    subprocess.run([GENERATOR, *words], check=True, capture_output=True, cwd=tmp_path, timeout=120)
    _, secret = context.store.keys.create(name="generated", scopes=["submit"])
    with live_api(context) as url:
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, str(tmp_path), url, secret],
            capture_output=True,
            text=True,
            check=False,
            timeout=120,
        )
    assert done.returncode == 0, done.stderr
    assert context.store.jobs.get(done.stdout.strip()).seed == 5


def test_operations_have_short_names_of_their_own() -> None:
    names = Counter(
        operation["operationId"]
        for operations in contract()["paths"].values()
        for operation in operations.values()
    )
    assert names.most_common(1)[0][1] == 1
    assert "submit_sweep" in names
