"""The whole OpenAPI contract under generated requests, and a client that is generated of it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import schemathesis
from hypothesis import strategies
from support.clients.tenants import ADMIN, WITH_KEYS
from support.contract import contract
from support.programs import captured
from support.servers.contract import SCHEMA, ask, ways
from support.servers.live_api import live_api

from buildarena_backend.catalog.specs import SweepSpec

pytestmark = pytest.mark.ci

FRAMING = {"content-length", "transfer-encoding", "connection", "expect"}
"""A request that announces what it does not send has no end, and no answer."""
schemathesis.serializer.alias(["application/zip"], "application/octet-stream")
schemathesis.openapi.media_type("application/zip", strategies.binary(max_size=100))
# Streams have no end; test_sweeps.py reads them.
WAYS = ways(SCHEMA.exclude(path_regex="/events$"))
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
    assert [found.id for found in list_jobs.sync(client=client).data] == [job.id]
    payload = SweepSpec(tasks=["lift-1"], models=["builtin/idle"], seeds=[5, 6])
    sweep = submit_sweep.sync(client=client, body=payload)
    assert show_sweep.sync(sweep.id, client=client).progress.total == 2
    wrong = submit_job.sync(client=client, body=JobSpec(task="lift-9", model="builtin/idle"))
    assert isinstance(wrong, Problem), wrong
    assert wrong.errors[0].field == "task"
    print(job.id)
"""


@pytest.mark.nightly(keep=3)
@pytest.mark.parametrize("way", WAYS, ids=lambda way: f"{way[0].label}-{way[1].value}")
def test_every_answer_is_a_documented_one(context, submissions, way) -> None:
    """Under generated requests, at a service that counts none; never a 5xx."""

    def prepare(case) -> None:
        for name in [name for name in case.headers or {} if name.lower() in FRAMING]:
            del case.headers[name]

    submissions.submit_sweep(SweepSpec(tasks=["lift-1"], models=["builtin/idle"], seeds=[0, 1]))
    with live_api(context, **{**WITH_KEYS, "require_keys": False}) as url:
        ask(url, way, 5, prepare, Authorization=f"Bearer {ADMIN}")


def test_a_client_that_a_public_generator_makes_submits_a_job(context, tmp_path) -> None:
    target, document = tmp_path / "arena", tmp_path / "openapi.json"
    document.write_text(json.dumps(contract()))
    words = ["generate", "--path", str(document), "--meta", "none", "--output-path", str(target)]
    subprocess.run([GENERATOR, *words], check=True, capture_output=True, cwd=tmp_path, timeout=120)
    _, secret = context.store.keys.create(name="generated", scopes=["submit"])
    with live_api(context) as url:
        program = [sys.executable, "-c", PROGRAM, str(tmp_path), url, secret]
        done = captured(program, within_s=120)
    assert done.returncode == 0, done.stderr
    assert context.store.jobs.get(done.stdout.strip()).seed == 5
