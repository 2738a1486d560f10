"""The asynchronous client is made of the synchronous one, the types of the contract."""

from __future__ import annotations

import inspect
import json
import subprocess
import sys
from pathlib import Path

import pytest

from buildarena_client import AsyncClient, Client
from buildarena_client.event_streams import EventReader

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "clients" / "python" / "src" / "buildarena_client"
sys.path.insert(0, str(ROOT / "clients" / "python"))

from generate import async_client, schemas  # noqa: E402 - they are no installed package

METHODS = [name for name, _ in inspect.getmembers(Client, callable) if not name.startswith("_")]


@pytest.mark.parametrize("module", async_client.MODULES)
def test_the_asynchronous_modules_are_made_of_the_synchronous_ones(module) -> None:
    kept = (PACKAGE / "asynchronous" / f"{module}.py").read_text()
    assert async_client.asynchronous(module) == kept, "run `make client-modules`"


def test_the_types_are_the_contracts() -> None:
    contract = json.loads((ROOT / "tests" / "data" / "openapi.json").read_text())
    assert schemas.written(contract) == (PACKAGE / "schemas.py").read_text(), "run `make openapi`"
    changed = json.dumps(contract).replace('"cancelled"', '"stopped"')
    assert schemas.written(json.loads(changed)) != (PACKAGE / "schemas.py").read_text()


@pytest.mark.parametrize("name", METHODS)
def test_each_method_is_in_both_and_takes_the_same(name) -> None:
    one, other = getattr(Client, name), getattr(AsyncClient, name)
    assert inspect.signature(one).parameters == inspect.signature(other).parameters
    assert inspect.getdoc(one) == inspect.getdoc(other)
    ends_later = inspect.iscoroutinefunction(other) or "Async" in str(
        inspect.signature(other).return_annotation
    )
    assert ends_later


def test_every_route_of_a_caller_has_a_method() -> None:
    """What the API gains, the client gains; runners, keys and metrics have clients of their own."""
    contract = json.loads((ROOT / "tests" / "data" / "openapi.json").read_text())
    text = "".join(file.read_text() for file in (PACKAGE / "synchronous").glob("*.py"))
    named = {
        operation["operationId"]
        for path, operations in contract["paths"].items()
        for operation in operations.values()
        if not path.startswith(("/v1/runner", "/v1/keys", "/v1/metrics"))
    }
    for operation in sorted(named):
        words = CALLED.get(operation, operation.removeprefix("list_").removeprefix("show_"))
        assert f"def {words}(" in text, operation


CALLED = {
    "check_machine": "check_machine",
    "get_artifact": "transcript",
    "get_artifact_by_name": "artifact",
    "get_trajectory": "trajectory",
    "export": "export_leaderboard",
    "agreement_table": "agreement",
    "stream_job": "job_events",
    "stream_sweep": "sweep_events",
    "try_file": "try_machine",
    "verify": "verify_leaderboard",
}


def loaded_by(program: str) -> set[str]:
    told = f"{program}\nimport sys, json; print(json.dumps([n.split('.')[0] for n in sys.modules]))"
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    return set(json.loads(done.stdout))


HEAVY = {"httpx", "pandas", "polars", "numpy", "pydantic", "yaml", "anyio", "buildarena_geometry"}


def test_loading_and_asking_load_the_standard_library_alone() -> None:
    assert loaded_by("import buildarena_client") & {*HEAVY, "http", "ssl", "urllib"} == set()
    asking = (
        "import buildarena_client as c\ntry: c.Client('http://127.0.0.1:1').jobs().__next__()\n"
    )
    assert loaded_by(asking + "except c.UnreachableError: pass") & HEAVY == set()
    assert loaded_by("import buildarena_client as c; c.AsyncClient('http://x')") >= {"httpx"}


@pytest.mark.parametrize(
    ("missing", "program", "says"),
    [
        ("httpx", "c.AsyncClient('http://x')", "buildarena-client[async]"),
        ("yaml", "c.Client('http://x').submit_sweep(pathlib.Path('x'))", "buildarena-client[yaml]"),
        ("pandas", "c.jobs_frame([])", "buildarena-client[pandas]"),
        ("polars", "c.jobs_frame([], kind='polars')", "buildarena-client[polars]"),
    ],
)
def test_a_library_that_is_missing_is_named_with_its_extra(missing, program, says) -> None:
    told = (
        f"import sys, pathlib; sys.modules[{missing!r}] = None; import buildarena_client as c\n"
        f"try: {program}\nexcept c.MissingLibraryError as error: print(error)"
    )
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    assert says in done.stdout
    assert missing in done.stdout.lower() or missing == "yaml"


def test_extras_are_those_that_messages_name() -> None:
    import tomllib

    told = tomllib.loads((ROOT / "clients" / "python" / "pyproject.toml").read_text())
    assert set(told["project"]["optional-dependencies"]) == {"async", "pandas", "polars", "yaml"}
    assert told["project"]["dependencies"] == []


def test_events_are_the_same_wherever_the_stream_is_cut() -> None:
    stream = b""
    for number in range(1, 4):
        data = json.dumps({"job": "j", "sweep": None, "at": "t", "said": "aé\u2028"}).encode()
        stream += b"id: %d\r\nevent: turn\r\ndata: %s\r\n\r\n: ping\r\n\r\n" % (number, data)
    whole = list(EventReader().feed(stream))
    assert [event["id"] for event in whole] == [1, 2, 3]
    for size in range(1, 40):
        reader = EventReader()
        pieces = [stream[at : at + size] for at in range(0, len(stream), size)]
        assert [event for piece in pieces for event in reader.feed(piece)] == whole
