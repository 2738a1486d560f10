"""Keys of providers, held against the registry of models, before a job asks for one."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from buildarena_pipeline.catalog.models import load_registry
from buildarena_worker.providers.keys import key_report

BARE = {"PATH": os.environ["PATH"]}
OWN = """
models: [{name: own/big, provider: own, model: big}]
providers: {own: {protocol: openai, base_url: "http://vllm:8000/v1", key: OWN_API_KEY}}
"""


def check(*models: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "buildarena_worker", "--check", *models],
        env={**BARE, **variables},
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_key_that_no_provider_names_is_told() -> None:
    report = key_report(load_registry(), {"GEMINI_API_KEY": "x", "GOOGLE_API_KEY": "y", "A": "z"})
    assert report.there == ("GOOGLE_API_KEY",)
    assert report.strangers == ("GEMINI_API_KEY",)
    assert "google/gemini-2.0-flash" not in report.without
    assert "OPENAI_API_KEY_FILE" in report.without["openai/gpt-5"]


def test_an_operators_models_have_keys_too(tmp_path) -> None:
    models = tmp_path / "models.yaml"
    models.write_text(OWN)
    report = key_report(load_registry(models), {"OWN_API_KEY_FILE": str(tmp_path / "none")})
    assert not report.strangers
    assert "No such file" in report.without["own/big"]
    assert not [name for name in report.without if name.startswith("builtin/")]


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(
    ("models", "variables", "says"),
    [
        ((), {"GEMINI_API_KEY": "x"}, "GEMINI_API_KEY: no provider's key"),
        (("openai/gpt-5",), {}, "openai/gpt-5: neither OPENAI_API_KEY nor"),
        (("openai/gpt-6",), {}, "openai/gpt-6: no such model"),
    ],
)
def test_the_worker_says_what_is_wrong_without_starting(models, variables, says) -> None:
    done = check(*models, **variables)
    assert done.returncode == 1, done.stderr
    assert says in done.stdout


@pytest.mark.ci
def test_the_worker_says_what_is_there(tmp_path) -> None:
    file = tmp_path / "key"
    file.write_text("sk-very-secret")
    done = check("openai/gpt-5", OPENAI_API_KEY_FILE=str(file))
    assert done.returncode == 0, done.stdout
    assert "OPENAI_API_KEY: there" in done.stdout
    assert "very-secret" not in done.stdout + done.stderr


def test_what_the_compose_file_offers_are_keys_of_providers() -> None:
    offered = (Path(__file__).parents[3] / "deploy/docker/providers.env").read_text()
    variables = {line.strip("# =\n") for line in offered.splitlines() if line.endswith("=")}
    assert variables == {p.key for p in load_registry().providers.values() if p.key}
