"""Both clients have the same methods, every route has one, and types follow the contract."""

import importlib.util
import inspect
import json
import subprocess
import sys
import tomllib
import types
from pathlib import Path
from typing import NotRequired, get_origin, get_type_hints

import pytest
from support.contract import contract

from buildarena_client import AsyncClient, Client, schemas
from buildarena_client.client import run

ROOT = Path(__file__).parents[2]
PROJECT = ROOT / "clients" / "python"
CONTRACT = contract()
METHODS = [
    name for name, _ in inspect.getmembers(AsyncClient, callable) if not name.startswith("_")
]


@pytest.mark.parametrize("name", METHODS)
def test_each_method_is_in_both_and_takes_the_same(name) -> None:
    blocking, awaited = getattr(Client, name), getattr(AsyncClient, name)
    assert inspect.signature(blocking).parameters == inspect.signature(awaited).parameters
    assert inspect.getdoc(blocking) == inspect.getdoc(awaited)
    assert not inspect.iscoroutinefunction(blocking)
    assert inspect.iscoroutinefunction(awaited) or "AsyncGenerator" in str(
        inspect.signature(awaited).return_annotation
    )


def test_a_coroutine_that_suspends_is_refused_without_an_event_loop() -> None:
    @types.coroutine
    def suspends():
        yield

    with pytest.raises(RuntimeError, match="must block"):
        run(suspends())


def test_every_route_of_a_caller_has_a_method() -> None:
    """What the API gains, the client gains; runners, keys and metrics have clients of their own."""
    operations = {
        operation["operationId"]
        for path, operations in CONTRACT["paths"].items()
        for operation in operations.values()
        if not path.startswith(("/v1/runner", "/v1/keys", "/v1/metrics"))
    }
    methods = {
        CALLED.get(operation, operation.removeprefix("list_").removeprefix("show_"))
        for operation in operations
    }
    assert methods - set(METHODS) == set()


CALLED = {
    "get_artifact": "transcript",
    "get_artifact_by_name": "artifact",
    "get_trajectory": "trajectory",
    "export": "export_leaderboard",
    "forecast_sweep": "sweep_forecast",
    "stream_job": "job_events",
    "stream_sweep": "sweep_events",
    "summarise_jobs": "job_summary",
    "try_file": "try_machine",
    "verify": "verify_leaderboard",
}


def test_types_have_the_keys_of_the_contract() -> None:
    documents = CONTRACT["components"]["schemas"]
    typed = {name for name in documents if inspect.isclass(getattr(schemas, name, None))}
    assert {"JobDetail", "SweepView", "Board", "ToolOutcome"} <= typed
    for name in typed:
        hints = get_type_hints(getattr(schemas, name), include_extras=True)
        required = {key for key, hint in hints.items() if get_origin(hint) is not NotRequired}
        assert hints.keys() == documents[name]["properties"].keys(), name
        assert required == set(documents[name].get("required", ())), name


def test_types_change_with_the_contract() -> None:
    spec = importlib.util.spec_from_file_location("hatch_build", PROJECT / "hatch_build.py")
    build = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(build)
    text = build.module_text(CONTRACT)
    assert text == Path(schemas.__file__).read_text(), "run `make install`"
    changed = json.loads(json.dumps(CONTRACT).replace('"cancelled"', '"stopped"'))
    assert build.module_text(changed) != text


def ran(program: str, *options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *options, "-c", program]
    return subprocess.run(command, capture_output=True, text=True, check=True)


def loaded_by(program: str) -> set[str]:
    names = "import sys, json; print(json.dumps([n.split('.')[0] for n in sys.modules]))"
    return set(json.loads(ran(f"{program}\n{names}").stdout))


HEAVY = {"httpx", "httpx2", "pandas", "polars", "numpy", "pydantic", "yaml", "anyio", "asyncio"}


def test_loading_and_asking_load_the_standard_library_alone() -> None:
    assert loaded_by("import buildarena_client") & {*HEAVY, "http", "ssl", "urllib"} == set()
    asking = (
        "import buildarena_client as c\ntry: c.Client('http://127.0.0.1:1').jobs().__next__()\n"
    )
    loaded = loaded_by(asking + "except c.UnreachableError: pass")
    assert loaded & {*HEAVY, "buildarena_geometry"} == set()
    assert loaded_by("import buildarena_client as c; c.AsyncClient('http://x')") >= {"httpx2"}


@pytest.mark.parametrize(
    ("missing", "program", "says"),
    [
        ("httpx2", "c.AsyncClient('http://x')", "buildarena-client[async]"),
        ("yaml", "c.Client('http://x').submit_sweep(pathlib.Path('x'))", "buildarena-client[yaml]"),
        ("pandas", "c.jobs_frame([])", "buildarena-client[pandas]"),
        ("polars", "c.jobs_frame([], kind='polars')", "buildarena-client[polars]"),
    ],
)
def test_a_library_that_is_missing_is_named_with_its_extra(missing, program, says) -> None:
    done = ran(
        f"import sys, pathlib; sys.modules[{missing!r}] = None; import buildarena_client as c\n"
        f"try: {program}\nexcept c.MissingLibraryError as error: print(error)"
    )
    assert says in done.stdout
    assert missing in done.stdout.lower() or missing == "yaml"


def test_extras_are_those_that_messages_name() -> None:
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text())["project"]
    assert set(project["optional-dependencies"]) == {"async", "pandas", "polars", "yaml"}
    assert project["dependencies"] == []
