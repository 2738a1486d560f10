"""Sweep files: every mistake named with line and field, flags, and the published schema."""

import json
from pathlib import Path

import pytest
import yaml
from jsonschema import Draft202012Validator
from support.clients.commands import printed, run, run_cli
from support.clients.terminals import on_terminal

from buildarena_cli.sweep_files import sweep_schema

ROOT = Path(__file__).parents[2]
SCHEMA = ROOT / "docs" / "sweep.schema.json"
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


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("samples: 3", "samples: [", "8: not valid YAML"),
        ("samples: 3", "samples: three", "6: samples: Input should be a valid integer"),
        ("samples: 3", "samples: 0", "6: samples: Input should be greater than or equal to 1"),
        ("samples: 3", "samples: 3\nseeds: [1]", "6: samples: give either seeds or samples"),
        ("samples: 3", "seeds: [1, -2]", "6: seeds[1]: Input should be greater than"),
        ("samples: 3", "sample: 3", "6: sample: there is no such field; choose from workflow, "),
        ("samples: 3", "samples: 3\nsamples: 4", "7: samples: appears twice, first in line 6"),
        ("models: [builtin/idle]\n", "", "1: models: Field required"),
        (
            "models: [builtin/idle]",
            "models: builtin/idle",
            "5: models: Input should be a valid list",
        ),
        ("models: [builtin/idle]", "models: []", "5: models: List should have at least 1 item"),
        ("  - lift-1", "  - [lift-1]", "4: tasks[1]: Input should be a valid string"),
        ("  - lift-1", "  - &a lift-1\n  - *a", "4: anchors and aliases are not allowed"),
        ("temperature: 0.5", "temperature: 5", "8: decoding.temperature: Input should be less"),
        ("temperature: 0.5", "heat: 5", "8: decoding.heat: there is no such field; choose from "),
        (GOOD, "- 1\n", "1: must be a mapping of fields"),
        (GOOD, "", "1: must be a mapping of fields"),
    ],
)
def test_a_mistake_is_reported_before_anything_is_sent(file, old, new, says) -> None:
    assert old in GOOD
    file.write_text(GOOD.replace(old, new))
    done = run("sweep", "run", str(file), "--url", "http://127.0.0.1:1")
    assert done.returncode == 1
    assert done.stderr.startswith(f"{file}:{says}"), done.stderr


def test_every_mistake_has_its_line(file) -> None:
    file.write_text(GOOD.replace("samples: 3", "samples: x").replace("0.5", "hot"))
    lines = run("sweep", "run", str(file), "--url", "http://127.0.0.1:1").stderr.splitlines()
    assert [line.split(": ")[:2] for line in lines] == [
        [f"{file}:8", "decoding.temperature"],
        [f"{file}:6", "samples"],
    ]


def test_what_the_service_does_not_know_is_reported_with_its_line(url, file) -> None:
    text = GOOD.replace("lift-1", "lift-9").replace(
        "[builtin/idle]", "\n  - builtin/idle\n  - gpt-6"
    )
    file.write_text(text.replace("simulator: mujoco", "simulator: unity"))
    for words in ([], ["--dry-run"]):
        done = run_cli(url, "sweep", "run", str(file), *words)
        assert done.returncode == 1
        task, model, simulator = done.stderr.splitlines()
        assert task.startswith(f"{file}:4: tasks[1]: there is no task 'lift-9'; choose from ")
        assert model.startswith(f"{file}:7: models[1]: there is no model 'gpt-6'; choose from ")
        assert "openai/gpt-5" in model
        assert simulator.startswith(f"{file}:11: simulator: there is no simulator 'unity'; choose")


@pytest.mark.ci
def test_a_dry_run_says_what_the_sweep_could_show(url, file) -> None:
    words = ["sweep", "run", str(file), "--dry-run", "--url", url, "--samples"]
    code, told = on_terminal(120, *words, "64", NO_COLOR="1")
    assert code == 0, told
    assert "64 trials of each model on each task" in told
    assert "trials of each model on each task show 10 points over all tasks" in told
    _, few = on_terminal(120, *words, "3", NO_COLOR="1")
    assert "not at all" in few


def test_flags_take_the_place_of_the_files_fields(url, file) -> None:
    words = ["sweep", "run", str(file), "--dry-run", "--json"]
    assert json.loads(printed(url, *words))["jobs"] == 6
    flags = ["--task", "support-2", "--model", "builtin/idle", "--model", "builtin/random"]
    estimate = json.loads(printed(url, *words, *flags, "--samples", "5"))
    assert estimate["jobs"] == 10
    assert [model["model"] for model in estimate["models"]] == ["builtin/idle", "builtin/random"]
    assert json.loads(printed(url, *words, "--seed", "7"))["jobs"] == 2
    file.write_text(GOOD.replace("samples: 3", "seeds: [4, 5]"))
    assert json.loads(printed(url, *words, "--samples", "1"))["jobs"] == 2
    accepted = json.loads(
        printed(url, "sweep", "run", str(file), "--detach", "--seed", "9", "--json")
    )
    assert accepted["jobs"] == 2


def test_a_flags_mistake_is_reported_by_its_name(url, file) -> None:
    done = run_cli(url, "sweep", "run", str(file), "--task", "lift-1", "--task", "lift-9")
    assert done.returncode == 1
    assert done.stderr.startswith("--task: tasks[1]: there is no task 'lift-9'; choose from ")
    done = run_cli(url, "sweep", "run", str(file), "--samples", "0")
    assert (done.returncode, done.stderr.split(":")[0]) == (1, "--samples")
    assert run_cli(url, "sweep", "run", str(file), "--samples", "1", "--seed", "1").returncode == 2


def test_a_files_mistake_is_made_good_by_a_flag(url, file) -> None:
    file.write_text(GOOD.replace("samples: 3", "samples: many"))
    assert run_cli(url, "sweep", "run", str(file), "--dry-run").returncode == 1
    assert run_cli(url, "sweep", "run", str(file), "--dry-run", "--samples", "2").returncode == 0


def test_a_jobs_options_are_reported_with_their_lines(url, tmp_path) -> None:
    options = tmp_path / "options.yaml"
    options.write_text("simulator: mujoco\nlimits:\n  max_requests: 0\n")
    done = run_cli(url, "job", "submit", "lift-1", "builtin/idle", "--options", str(options))
    assert done.returncode == 1
    assert done.stderr.startswith(f"{options}:3: limits.max_requests: ")
    options.write_text("simulator: mujoco\n")
    done = run_cli(url, "job", "submit", "lift-9", "builtin/idle", "--options", str(options))
    assert done.stderr.startswith("TASK: task: there is no task 'lift-9'")


def test_the_published_schema_is_that_of_the_code() -> None:
    assert sweep_schema() == json.loads(SCHEMA.read_text()), "make generate NAME=sweeps"


def test_the_schema_takes_the_examples(subtests) -> None:
    for path in sorted((ROOT / "examples" / "sweeps").glob("*.yaml")):
        with subtests.test(path=path):
            schema = json.loads(SCHEMA.read_text())
            Draft202012Validator.check_schema(schema)
            Draft202012Validator(schema).validate(yaml.safe_load(path.read_text()))


def test_the_schema_refuses_what_the_code_refuses() -> None:
    validator = Draft202012Validator(json.loads(SCHEMA.read_text()))
    good = yaml.safe_load(GOOD)
    assert validator.is_valid(good)
    for change in (
        {"sample": 3},
        {"tasks": []},
        {"decoding": {"temperature": 9}},
        {"samples": "1"},
    ):
        assert not validator.is_valid({**good, **change}), change
