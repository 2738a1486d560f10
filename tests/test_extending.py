"""docs/extending.md, word for word: each of its distributions is installed and used."""

import json
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler
from pathlib import Path

import pytest
from support.programs import captured
from support.servers.in_threads import Quiet, serving

GUIDE = (Path(__file__).parents[1] / "docs" / "extending.md").read_text()


def section(title: str) -> str:
    return re.split(r"^## ", GUIDE, flags=re.MULTILINE)[
        re.findall(r"^## (.*)$", GUIDE, re.MULTILINE).index(title) + 1
    ]


def block(title: str, language: str) -> str:
    (text,) = re.findall(rf"```{language}\n(.*?)```", section(title), re.DOTALL)
    return str(text)


def installed(title: str, folder: Path) -> dict[str, str]:
    """The environment of a program beside which a section's distribution is installed."""
    project = tomllib.loads(block(title, "toml"))["project"]
    ((group, points),) = project["entry-points"].items()
    ((name, target),) = points.items()
    (folder / f"{target.partition(':')[0]}.py").write_text(block(title, "python"))
    facts = folder / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text(f"Name: {project['name']}\nVersion: {project['version']}\n")
    (facts / "entry_points.txt").write_text(f"[{group}]\n{name} = {target}\n")
    return {**os.environ, "PYTHONPATH": str(folder)}


def run(environment: dict[str, str], *words: object) -> subprocess.CompletedProcess[str]:
    return captured([sys.executable, *map(str, words)], env=environment)


@pytest.fixture
def car(play, tmp_path) -> Path:
    file = tmp_path / "car.json"
    machine = play("builtin/expert", task="transport-1").suspended.machine
    file.write_text(json.dumps(machine.to_document()))
    return file


@pytest.mark.ci
def test_a_scorer_is_one_file(car, tmp_path) -> None:
    environment = installed("A scorer", tmp_path)
    task = tmp_path / "north.yaml"
    task.write_text(
        "name: north\ntitle: Northwards\ncategory: races\nstatement: Drive north.\n"
        "scenario: {duration_s: 4, control: {mode: agent}}\n"
        "scoring: {name: northing, min_distance: 5}\nindicator: {name: distance, unit: units}\n"
    )
    command = ("-m", "buildarena_cli", "machine", "simulate", car, "--task", task, "--json")
    done = run(environment, *command, "--engine", "mujoco")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["indicator"] > 5
    task.write_text(task.read_text().replace("mode: agent", "mode: none"))
    refused = run(environment, *command)
    assert "scenario.control.mode must be agent" in refused.stderr
    without = run({**environment, "PYTHONPATH": ""}, *command)
    assert "northing" in without.stderr
    assert "'support'" in without.stderr


@pytest.mark.ci
def test_an_engine_is_one_module(car, tmp_path) -> None:
    environment = installed("An engine", tmp_path)
    command = ("-m", "buildarena_cli", "machine", "simulate", car, "--task", "transport-1")
    found = {}
    for engine in ("mujoco", "mujoco-half"):
        done = run(environment, *command, "--json", "--engine", engine)
        assert done.returncode == 0, done.stderr
        found[engine] = json.loads(done.stdout)["indicator"]
    assert found["mujoco-half"] == pytest.approx(found["mujoco"], rel=0.05)
    assert found["mujoco-half"] != found["mujoco"]
    refused = run({**environment, "PYTHONPATH": ""}, *command, "--engine", "mujoco-half")
    assert "there are pybullet, mujoco" in refused.stderr


@pytest.fixture
def endpoint() -> Iterator[str]:
    class Talker(Quiet, BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            asked = self.rfile.read(int(self.headers["Content-Length"])).decode()
            status = 200 if self.headers["Authorization"] == "Bearer secret" else 401
            self.send_response(status)
            self.end_headers()
            self.wfile.write(f"You said {asked!r}.".encode())

    with serving(Talker) as url:
        yield f"{url}/reply"


ASKING = """
import sys
from pathlib import Path
from buildarena_backend.catalog.models import load_registry
from buildarena_worker.providers.provider import ModelClients
from buildarena_worker.providers.registry import require_known_protocols
from buildarena_worker.session.messages import Message, Request

registry = load_registry(Path(sys.argv[1]))
require_known_protocols(registry)
config = {"name": "mine/talker", "decoding": {}}
client = ModelClients(registry).for_config(config)
said = client.complete(Request(model_config=config, messages=[Message(role="user", text="Hi")]))
print(said.text, said.usage.requests)
client.close()
"""


@pytest.mark.ci
def test_a_protocol_is_one_module(endpoint, tmp_path) -> None:
    environment = installed("A provider's protocol", tmp_path)
    file = tmp_path / "models.yaml"
    text = block("A provider's protocol", "yaml")
    file.write_text(text.replace("http://127.0.0.1:9000/reply", endpoint))
    done = run({**environment, "MINE_API_KEY": "secret"}, "-c", ASKING, file)
    assert done.stdout == "You said 'Hi'. 1\n", done.stderr
    refused = run({**environment, "MINE_API_KEY": "wrong"}, "-c", ASKING, file)
    assert "bad_credentials" in refused.stderr or "PermanentError" in refused.stderr
    without = run({**environment, "PYTHONPATH": ""}, "-c", ASKING, file)
    assert "provider 'mine': unknown protocol 'plain'" in without.stderr
    assert "anthropic, google, openai" in without.stderr
