"""The dashboard and a published site in a real browser, against a whole service."""

import json
import subprocess
from functools import partial
from http.server import SimpleHTTPRequestHandler

import httpx
import psutil
import pytest
from pydantic import SecretStr
from support.clients.tenants import ADMIN
from support.clients.terminals import BUILDARENA
from support.documents.pages import LOOKS, in_browser, needs_pages
from support.machines.random_machines import random_machine
from support.providers.stand_in import ProviderStandIn
from support.servers.in_threads import Quiet, serving
from support.servers.reverse_proxy import ProxyRules, reverse_proxy
from support.servers.stacks import finished, running_stack

from buildarena_geometry import Block, Machine, Refused

SWEEP = {"name": "pages", "tasks": ["support-1"], "seeds": [0], "simulator": "mujoco"}
SWEEP["models"] = ["builtin/expert", "builtin/idle"]
PLACE = "some/where"

pytestmark = needs_pages


def submit(client: httpx.Client, **changes: object) -> str:
    made = client.post("/v1/sweeps", json={**SWEEP, **changes}).raise_for_status()
    return str(made.json()["id"])


@pytest.mark.ci
def test_pages_work_in_a_browser(tmp_path) -> None:
    with running_stack(tmp_path) as stack, httpx.Client(base_url=stack.url) as client:
        finished(client, submit(client))
        for files in ("e2e/pages", "e2e/boards"):
            in_browser(stack.url, [files])


@pytest.mark.nightly
def test_people_build(tmp_path) -> None:
    with running_stack(tmp_path, simulators=("pybullet", "mujoco")) as stack:
        in_browser(stack.url, ["e2e/build", "e2e/program", "e2e/robust", "e2e/toy"])


@pytest.mark.ci
def test_pages_ask_for_a_key_and_offer_what_it_may(tmp_path) -> None:
    with running_stack(tmp_path, require_keys=True, admin_key=SecretStr(ADMIN)) as stack:
        given = {"BUILDARENA_WEB_GUARDED_URL": stack.url, "BUILDARENA_WEB_ADMIN_KEY": ADMIN}
        in_browser(stack.url, ["e2e/keys"], **given)


@pytest.mark.nightly
def test_pages_work_below_a_path(tmp_path) -> None:
    with (
        running_stack(tmp_path, base_path="/tools/arena") as stack,
        httpx.Client(base_url=stack.url) as client,
        reverse_proxy(stack.url, ProxyRules(prefix="/tools/arena")) as outer,
    ):
        sweep = submit(client, seeds=[*range(100)])  # open for as long as the browser looks
        client.post(f"/v1/sweeps/{sweep}/pause").raise_for_status()
        in_browser(outer, ["e2e/below"])


def built_session(client: httpx.Client, seed: int) -> dict[str, object]:
    """A session's job, and after each call where the geometry library says that every part is."""
    body = {"task": "support-1", "agent": "random", "seed": seed, "simulator": "mujoco"}
    job = client.post("/v1/sessions", json=body).raise_for_status().json()["id"]
    machine, steps = Machine(), []
    records = random_machine("support-1", seed).log.records[:60]
    calls = [(done.name, done.arguments) for done in records]
    for tool, arguments in (*calls, calls[1]):
        outcome = machine.act(tool, arguments)
        call = {"tool": tool, "arguments": arguments}
        told = client.post(f"/v1/sessions/{job}/calls", json=call)
        assert told.raise_for_status().json()["ok"] == outcome.ok
        tried = outcome.attempted if isinstance(outcome, Refused) else ()
        rods = {rod.id: [*rod.start_xyz, *rod.end_xyz] for rod in machine.connectors.values()}
        blocks = {block.id: pose(block) for block in machine.blocks.values()}
        steps.append({"blocks": blocks, "rods": rods, "ghosts": [pose(block) for block in tried]})
    return {"job": job, "steps": steps}


def pose(block: Block) -> list[float]:
    return [*block.world_from_block.xyz, *block.world_from_block.wxyz]


@pytest.mark.nightly
def test_the_room_of_a_job_shows_what_is(tmp_path) -> None:
    """Of machines that nobody chose, and of a call that is refused."""
    with running_stack(tmp_path) as stack:
        with httpx.Client(base_url=stack.url, timeout=30) as client:
            sweep = submit(client, models=["builtin/expert"], seeds=[0, 1])
            sessions = [built_session(client, seed) for seed in range(4)]
            finished(client, sweep)
        assert any(step["ghosts"] for session in sessions for step in session["steps"])
        file = tmp_path / "machines.json"
        file.write_text(json.dumps(sessions))
        in_browser(stack.url, ["e2e/room"], BUILDARENA_WEB_MACHINES=str(file))


def processes(*names: str) -> str:
    """Ids of the service's processes with one of these words among theirs."""
    found = []
    for process in psutil.Process().children(recursive=True):
        words = process.cmdline()
        if any(any(name in word for word in words) for name in names):
            found.append(str(process.pid))
    assert found
    return ",".join(found)


@pytest.mark.nightly
def test_a_session_is_watched_while_processes_die(tmp_path) -> None:
    with ProviderStandIn("expert", latency_s=0.3) as standin:
        models = tmp_path / "models.yaml"
        models.write_text(
            f"providers:\n  standin: {{protocol: openai, base_url: '{standin.url}/v1'}}\n"
            "models:\n  - {name: standin/expert, provider: standin, model: expert}\n"
        )
        with running_stack(tmp_path, models_file=models) as stack:
            payload = {"task": "support-1", "model": "standin/expert", "simulator": "mujoco"}
            job = httpx.post(f"{stack.url}/v1/jobs", json=payload).raise_for_status().json()["id"]
            told = {"BUILDARENA_WEB_WORKERS": processes("buildarena_worker")}
            told["BUILDARENA_WEB_APIS"] = processes("buildarena_api")
            in_browser(stack.url, ["e2e/live"], BUILDARENA_WEB_PLAYED=job, **told)


class Files(Quiet, SimpleHTTPRequestHandler):
    """Serves a folder as any static host does."""


@pytest.mark.nightly
@pytest.mark.parametrize("looks", LOOKS)
def test_a_site_works_from_a_file_server(tmp_path, looks) -> None:
    """Under a sub-path, with a name that is no markup."""
    host, name = tmp_path / "host", "</script><img src=x onerror=alert(1)>another"
    with running_stack(tmp_path) as stack, serving(partial(Files, directory=str(host))) as address:
        with httpx.Client(base_url=stack.url) as client:
            models = ["builtin/expert", "builtin/random", "builtin/idle"]
            published = {"name": "published", "tasks": ["support-1", "lift-1"], "seeds": [0, 1]}
            specs = (published, {"name": name, "seeds": [1]})
            sweeps = [submit(client, **{"models": models, **spec}) for spec in specs]
            for sweep in sweeps:
                finished(client, sweep)
        for name in ("all", "best"):
            words = ["--out", str(host / PLACE / name), "--jobs", name, "--url", stack.url]
            subprocess.run([BUILDARENA, "site", *sweeps, *words], check=True, timeout=120)
        sites = ",".join(f"{address}/{PLACE}/{name}/" for name in ("all", "best"))
        in_browser(stack.url, ["e2e/site"], BUILDARENA_WEB_SITES=sites, **looks)
