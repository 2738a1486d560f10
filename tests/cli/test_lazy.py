"""Help and completion load nothing that they do not need, and the table of commands is right."""

import inspect
import json
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
import typer
from support.clients.terminals import on_terminal, piped

from buildarena_cli import defaults
from buildarena_cli.command_table import COMMANDS
from buildarena_pipeline.runtime import settings

HEAVY = {
    *("buildarena_pipeline", "buildarena_store", "buildarena_simulation", "buildarena_geometry"),
    *("buildarena_benchmark", "buildarena_api", "httpx", "mcp", "matplotlib", "numpy", "rich"),
    *("pydantic", "pydantic_settings", "sqlalchemy", "structlog", "redis", "yaml", "jinja2"),
}
LOADED = (
    "import json, sys\n"
    "from buildarena_cli.main import run\n"
    "try:\n    run()\n"
    "finally:\n"
    "    sys.stderr.write('LOADED' + json.dumps([n.split('.')[0] for n in sys.modules]))\n"
)


def loaded_by(*words: str, **environment: str) -> set[str]:
    done = subprocess.run(
        [sys.executable, "-c", LOADED, *words],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **environment},
    )
    return set(json.loads(done.stderr.rpartition("LOADED")[2]))


@pytest.mark.nightly(keep=8)
@pytest.mark.parametrize("words", [["--help"], *([name, "--help"] for name in COMMANDS)])
def test_help_loads_no_library_that_it_does_not_need(words) -> None:
    assert loaded_by(*words) & {*HEAVY, "ssl"} == set()


def test_completion_loads_no_library_that_it_does_not_need(subtests) -> None:
    for shell in ["bash", "zsh", "fish"]:
        with subtests.test(shell=shell):
            environment = completing(
                shell, "buildarena job show ", BUILDARENA_URL="http://127.0.0.1:1"
            )
            assert loaded_by(**environment) & {*HEAVY, "ssl"} == set()


def test_asking_the_api_loads_none_either() -> None:
    for words in (["job", "list"], ["leaderboard"], ["sweep", "list"], ["doctor"]):
        assert loaded_by(*words, "--url", "http://127.0.0.1:1") & HEAVY == set()


def test_the_tables_sentence_is_the_commands_own(subtests) -> None:
    for name in COMMANDS:
        with subtests.test(name=name):
            entry = COMMANDS[name]
            found = getattr(
                import_module(f"buildarena_cli.commands.{entry.module}"), entry.attribute
            )
            if isinstance(found, typer.Typer):
                assert str(found.info.help).partition(". ")[0].rstrip(".") == entry.help.rstrip(".")
            else:
                assert str(inspect.getdoc(found)).splitlines()[0] == entry.help


def test_defaults_are_those_of_the_settings(monkeypatch) -> None:
    for name in list(os.environ):
        if name.startswith("BUILDARENA_"):
            monkeypatch.delenv(name)
    found = settings.Settings()
    assert found.port == defaults.DEFAULT_PORT
    assert found.data == Path(defaults.DEFAULT_DATA) == defaults.data_folder(None)


def completing(shell: str, line: str, **environment: str) -> dict[str, str]:
    return {
        "_BUILDARENA_COMPLETE": f"complete_{shell}",
        "COMP_WORDS": line,
        "COMP_CWORD": str(line.count(" ")),
        "_TYPER_COMPLETE_ARGS": line,
        "_TYPER_COMPLETE_FISH_ACTION": "get-args",
        **environment,
    }


def test_each_shell_is_offered_commands_and_options(subtests) -> None:
    for shell in ["bash", "zsh", "fish"]:
        with subtests.test(shell=shell):
            for line, word in (
                ("buildarena swe", "sweep"),
                ("buildarena sweep wat", "watch"),
                ("buildarena job list --rea", "--reason"),
            ):
                done = piped(**completing(shell, line))
                assert word in done.stdout, (line, done)


def test_each_shells_script_calls_the_command(subtests) -> None:
    for shell in ["bash", "zsh", "fish"]:
        with subtests.test(shell=shell):
            done = piped(_BUILDARENA_COMPLETE=f"source_{shell}")
            assert "_BUILDARENA_COMPLETE=complete_" + shell in done.stdout


def test_help_is_one_line_a_sentence_through_a_pipe_and_fits_a_terminal() -> None:
    sentence = COMMANDS["demo"].help
    assert any(line.endswith(sentence) for line in piped("--help").stdout.splitlines())
    code, shown = on_terminal(60, "--help")
    assert code == 0
    assert max(map(len, shown.splitlines())) <= 60


def test_a_usage_error_names_the_near_words_and_ends_with_code_2(subtests) -> None:
    for words, says in [
        (["leaderbord"], "did you mean leaderboard?"),
        (["key", "list"], "did you mean admin key?"),
        (["sweep", "wacth"], "did you mean watch?"),
        (["job", "list", "--taks", "x"], "--task"),
        (["jbo", "list"], "did you mean job?"),
    ]:
        with subtests.test(words=words):
            done = piped(*words)
            assert done.returncode == 2
            assert says in done.stderr


def test_the_script_and_the_module_are_one_command() -> None:
    module = subprocess.run(
        [sys.executable, "-m", "buildarena_cli", "--help"],
        capture_output=True,
        text=True,
        check=True,
    )
    script = piped("--help")
    assert module.stdout.partition("\n\n")[2] == script.stdout.partition("\n\n")[2]
