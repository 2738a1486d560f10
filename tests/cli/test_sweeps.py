"""Sweep files: every mistake named with line and field, flags, budgets, schema and examples."""

import json
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
import yaml
from jsonschema import Draft202012Validator
from support.clients.commands import printed, run, run_cli

from buildarena_backend.catalog.specs import SweepSpec
from buildarena_benchmark import parse_custom_task
from buildarena_cli.sweep_files import sweep_schema

ROOT = Path(__file__).parents[2]
NOWHERE = ("--url", "http://127.0.0.1:1")
GOOD = """\
name: first
tasks:
  - support-1
  - lift-1
models: [builtin/idle]
samples: 3
decoding:
  temperature: 0.5
simulator: mujoco
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "sweep.yaml"
    path.write_text(GOOD)
    return path


def test_a_mistake_is_reported_with_its_line_before_anything_is_sent(file, subtests) -> None:
    models = "models: [builtin/idle]"
    for old, new, says in (
        ("samples: 3", "samples: [", "8: not valid YAML"),
        ("samples: 3", "samples: three", "6: samples: Input should be a valid integer"),
        ("samples: 3", "samples: 0", "6: samples: Input should be greater than or equal to 1"),
        ("samples: 3", "samples: 3\nseeds: [1]", "6: samples: give either seeds or samples"),
        ("samples: 3", "seeds: [1, -2]", "6: seeds[1]: Input should be greater than"),
        ("samples: 3", "sample: 3", "6: sample: unknown field; choose from workflow, "),
        ("samples: 3", "samples: 3\nsamples: 4", "7: samples: appears twice, first in line 6"),
        (f"{models}\n", "", "1: models: Field required"),
        (models, "models: builtin/idle", "5: models: Input should be a valid list"),
        (models, "models: []", "5: models: List should have at least 1 item"),
        ("  - lift-1", "  - [lift-1]", "4: tasks[1]: Input should be a valid string"),
        ("  - lift-1", "  - &a lift-1\n  - *a", "4: anchors and aliases are not allowed"),
        ("temperature: 0.5", "temperature: 5", "8: decoding.temperature: Input should be less"),
        ("temperature: 0.5", "heat: 5", "8: decoding.heat: unknown field; choose from "),
        (GOOD, "- 1\n", "1: must be a mapping of fields"),
        (GOOD, "", "1: must be a mapping of fields"),
    ):
        with subtests.test(new=new):
            file.write_text(GOOD.replace(old, new))
            done = run("sweep", "run", str(file), *NOWHERE)
            assert done.returncode == 1
            assert done.stderr.startswith(f"{file}:{says}"), done.stderr
    file.write_text(GOOD.replace("samples: 3", "samples: x").replace("0.5", "hot"))
    lines = run("sweep", "run", str(file), *NOWHERE).stderr.splitlines()
    assert [line.split(": ")[0] for line in lines] == [f"{file}:8", f"{file}:6"]


def test_what_the_service_does_not_know_is_reported_with_its_line(url, file) -> None:
    text = GOOD.replace("lift-1", "lift-9").replace("[builtin/idle]", "\n  - gpt-6")
    file.write_text(text.replace("simulator: mujoco", "simulator: unity"))
    for words in ([], ["--dry-run"]):
        done = run_cli(url, "sweep", "run", str(file), *words)
        assert done.returncode == 1
        task, model, simulator = done.stderr.splitlines()
        assert task.startswith(f"{file}:4: tasks[1]: unknown task 'lift-9'; choose from ")
        assert model.startswith(f"{file}:6: models[0]: unknown model 'gpt-6'; choose from ")
        assert "openai/gpt-5" in model
        assert simulator.startswith(f"{file}:10: simulator: unknown simulator 'unity'; choose")


def test_flags_take_the_place_of_the_files_fields(url, file) -> None:
    words = ["sweep", "run", str(file), "--dry-run", "--json"]
    assert json.loads(printed(url, *words))["jobs"] == 6
    flags = ["--task", "support-2", "--model", "builtin/idle", "--model", "builtin/random"]
    estimate = json.loads(printed(url, *words, *flags, "--samples", "5"))
    assert estimate["jobs"] == 10
    assert [model["model"] for model in estimate["models"]] == ["builtin/idle", "builtin/random"]
    done = run_cli(url, "sweep", "run", str(file), "--task", "lift-1", "--task", "lift-9")
    assert done.returncode == 1
    assert done.stderr.startswith("--task: tasks[1]: unknown task 'lift-9'; choose from ")
    done = run_cli(url, "sweep", "run", str(file), "--samples", "0")
    assert (done.returncode, done.stderr.split(":")[0]) == (1, "--samples")
    assert run_cli(url, "sweep", "run", str(file), "--samples", "1", "--seed", "1").returncode == 2


@pytest.fixture
def sweep(submissions) -> str:
    spec = SweepSpec(tasks=["lift-1"], models=["builtin/expert"], samples=10, simulator="mujoco")
    return submissions.submit_sweep(spec).sweep.id


def test_a_budget_is_set_while_a_sweep_runs_and_after_it_was_used_up(url, context, sweep) -> None:
    assert "$0.00 of $5.00" in printed(url, "sweep", "budget", sweep, "--max-cost-usd", "5")
    with context.store.lifecycle.command() as connection:
        context.store.lifecycle.exhaust(sweep, "used up", connection=connection)
    stopped = printed(url, "sweep", "status", sweep)
    assert "stopped, as its budget is used up" in stopped
    assert f"buildarena sweep budget {sweep} --max-cost-usd" in stopped
    shown = printed(url, "sweep", "budget", sweep, "--max-cost-usd", "1")
    assert ": active\n" in shown
    assert "10  waiting to be built" in shown
    refused = run_cli(url, "sweep", "budget", sweep)
    assert (refused.returncode, "--max-requests" in refused.stderr) == (2, True)
    head, row = printed(url, "sweep", "list").splitlines()
    assert (head.split()[0], row.split("  ")[0]) == ("sweep", sweep)


def test_the_published_schema_is_the_codes_and_refuses_what_the_code_refuses() -> None:
    schema = json.loads((ROOT / "docs" / "sweep.schema.json").read_text())
    assert sweep_schema() == schema, "make generate NAME=sweeps"
    Draft202012Validator.check_schema(schema)
    validator, good = Draft202012Validator(schema), yaml.safe_load(GOOD)
    assert validator.is_valid(good)
    for change in ({"sample": 3}, {"tasks": []}, {"decoding": {"heat": 9}}, {"samples": "1"}):
        assert not validator.is_valid({**good, **change}), change


def test_the_sweeps_that_come_as_examples_can_be_submitted(context, submissions) -> None:
    for file in (ROOT / "examples" / "tasks").glob("*.yaml"):
        text = file.read_text()
        context.tasks.add(parse_custom_task(text, origin=file.name), text)
    validator = Draft202012Validator(sweep_schema())
    for file in sorted((ROOT / "examples" / "sweeps").glob("*.yaml")):
        document = yaml.safe_load(file.read_text())
        validator.validate(document)
        spec = SweepSpec.model_validate(document)
        jobs = submissions.plan(spec)
        assert sum(len(some.seeds) for some in jobs) == len(spec.tasks) * len(spec.models) * len(
            spec.all_seeds()
        ), file.name


def test_ctrl_c_says_that_the_sweep_goes_on_and_twice_pauses_it(url, context, sweep) -> None:
    words = [sys.executable, "-m", "buildarena_cli", "sweep", "watch", sweep, "--url", url]
    # Below a shell in the background a child would ignore the signal.
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    with subprocess.Popen(
        words,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=heard,  # noqa: PLW1509 - it takes no lock
    ) as watching:
        assert watching.stdout is not None
        assert watching.stderr is not None
        assert "jobs ended" in watching.stdout.readline()
        watching.send_signal(signal.SIGINT)
        watching.stderr.readline()
        told = watching.stderr.readline()
        for verb in ("watch", "pause", "cancel"):
            assert f"`buildarena sweep {verb} {sweep}`" in told
        assert context.store.sweeps.get(sweep).state == "active"
        watching.send_signal(signal.SIGINT)
        assert watching.wait(timeout=20) == 130
    assert context.store.sweeps.get(sweep).state == "paused"


def test_a_budget_keeps_what_is_not_named(url, sweep) -> None:
    printed(url, "sweep", "budget", sweep, "--max-cost-usd", "5")
    printed(url, "sweep", "budget", sweep, "--max-requests", "9")
    budget = json.loads(printed(url, "sweep", "status", sweep, "--json"))["budget"]
    assert (budget["max_cost_usd"], budget["max_requests"], budget["max_tokens"]) == (5, 9, None)
