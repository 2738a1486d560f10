"""The OpenAPI contract, and what stands in lists: tasks, models, modules, simulators, versions."""

import json
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
import schemathesis
from hypothesis import strategies
from support.clients.tenants import ADMIN, WITH_KEYS
from support.contract import contract
from support.jobs import report_worker
from support.servers.contract import SCHEMA, ask, ways
from support.servers.live_api import changed, live_api

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.statistics import MIN_SUCCESSES
from buildarena_geometry import FEEDBACK_VERSION
from buildarena_pipeline import __version__
from buildarena_pipeline.catalog.specs import JobSpec, SweepSpec
from buildarena_simulation import SIMULATION_VERSION
from buildarena_store.states import simulate_queue

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
    assert [found.id for found in list_jobs.sync(client=client).jobs] == [job.id]
    payload = SweepSpec(tasks=["lift-1"], models=["builtin/idle"], seeds=[5, 6])
    sweep = submit_sweep.sync(client=client, body=payload)
    assert show_sweep.sync(sweep.id, client=client).progress.total == 2
    wrong = submit_job.sync(client=client, body=JobSpec(task="lift-9", model="builtin/idle"))
    assert isinstance(wrong, Problem), wrong
    assert wrong.errors[0].field == "task"
    print(job.id)
"""


@pytest.mark.ci
@pytest.mark.nightly(keep=3)
@pytest.mark.parametrize("way", WAYS, ids=lambda way: f"{way[0].label}-{way[1].value}")
def test_every_answer_is_a_documented_one(context, submissions, way) -> None:
    """Under generated requests, at a service that counts none; never a 5xx."""

    def prepare(case) -> None:
        for name in [name for name in case.headers or {} if name.lower() in FRAMING]:
            del case.headers[name]

    submissions.submit_sweep(SweepSpec(tasks=["lift-1"], models=["builtin/idle"], seeds=[0, 1]))
    with changed(context, **{**WITH_KEYS, "require_keys": False}) as own, live_api(own) as url:
        ask(url, way, 5, prepare, Authorization=f"Bearer {ADMIN}")


@pytest.mark.ci
def test_a_client_that_a_public_generator_makes_submits_a_job(context, tmp_path) -> None:
    target, document = tmp_path / "arena", tmp_path / "openapi.json"
    document.write_text(json.dumps(contract()))
    words = ["generate", "--path", str(document), "--meta", "none", "--output-path", str(target)]
    subprocess.run([GENERATOR, *words], check=True, capture_output=True, cwd=tmp_path, timeout=120)
    _, secret = context.store.keys.create(name="generated", scopes=["submit"])
    with live_api(context) as url:
        program = [sys.executable, "-c", PROGRAM, str(tmp_path), url, secret]
        done = subprocess.run(program, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    assert context.store.jobs.get(done.stdout.strip()).seed == 5


def test_the_contract_and_its_page_need_no_other_server(api) -> None:
    operations = (one for path in contract()["paths"].values() for one in path.values())
    names = Counter(operation["operationId"] for operation in operations)
    assert names.most_common(1)[0][1] == 1
    assert "submit_sweep" in names
    sources = re.findall(r'(?:src|href)="([^"]+)"', api.get("/docs").text)
    assert sources
    for source in sources:
        assert source.startswith("/")
        assert api.get(source).status_code == 200


def test_lists_hold_what_can_be_submitted(api, submissions) -> None:
    tasks = {task["name"]: task for task in api.get("/v1/tasks").json()}
    assert tasks.keys() == builtin_tasks().keys()
    assert tasks["support-1"]["indicator"]
    models = {model["name"]: model for model in api.get("/v1/models").json()}
    assert models["builtin/expert"]["baseline"]
    modules = {one["name"]: one for one in api.get("/v1/modules").json()}
    assert modules["Powered Wheel"]["size"] == [2, 2, 0.5]
    assert modules["Powered Wheel"]["actions"] == ["spinning_forward", "spinning_backward"]
    assert modules["Brace"]["size"] is None
    assert modules["Small Wooden Block"]["faces"] == list("ABCDEF")
    # Versions in use are those of a new job's track.
    used = api.get("/v1/versions").json()
    job, _ = submissions.submit_job(JobSpec(task="lift-1", model="builtin/idle", seed=0))
    simulators = {one["name"]: one["version"] for one in used["simulators"]}
    track = job.track_config
    assert simulators[track["simulator"]] == track["simulation_version"]
    assert used["feedback"] == track["feedback_version"] == FEEDBACK_VERSION
    assert (used["buildarena"], used["min_successes"]) == (__version__, MIN_SUCCESSES)
    assert used["error"] == 0.05


def test_simulators_are_our_engines_and_what_workers_announce(context, api) -> None:
    def listed() -> dict[str, dict[str, object]]:
        return {view["name"]: view for view in api.get("/v1/simulators").json()}

    ours = {"version": SIMULATION_VERSION, "kind": "engine", "repeatable": True}
    ours |= {"workers": 0, "served": False}
    assert listed() == {
        name: {"name": name, "default": name == "pybullet", **ours}
        for name in ("pybullet", "mujoco")
    }
    spec = {"task": "support-1", "model": "builtin/idle", "simulator": "unity"}
    refused = api.post("/v1/jobs", json=spec)
    assert refused.status_code == 422
    assert refused.json()["errors"][0]["choices"] == ["pybullet", "mujoco"]
    for number, name in enumerate(("unity", "unity", "mujoco")):
        versions = {"simulation": "7.1", "kind": "game", "repeatable": False}
        report_worker(context, f"worker-{number}", simulate_queue(name), versions=versions)
    unity, mujoco = listed()["unity"], listed()["mujoco"]
    assert (unity["version"], unity["kind"], unity["default"]) == ("7.1", "game", False)
    assert (unity["workers"], unity["served"]) == (2, True)
    assert (mujoco["version"], mujoco["served"]) == (SIMULATION_VERSION, True)
    assert api.post("/v1/jobs", json=spec).status_code == 202
