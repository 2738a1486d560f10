"""A file that is not there is one sentence and a usage error, whichever command it is given to."""

import json
import sys
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import pytest
from support.machines.experts import experts_machine
from typer.core import TyperArgument
from typer.main import get_command

from buildarena_cli import main

WRITTEN = {"out", "video", "data", "trace"}
"""Parameters of paths that commands write, or keep what they run on in."""
NAMES_OR_FILES = ("or a task file", "or the path of its YAML file", "Folder or URL of")
"""What the help of parameters says that are names or paths."""


def commands() -> Iterator[tuple[tuple[str, ...], object]]:
    waiting = [((), get_command(main.app))]
    while waiting:
        path, command = waiting.pop()
        if not hasattr(command, "list_commands"):
            yield path, command
            continue
        names = command.list_commands(None)
        waiting.extend(((*path, name), command.get_command(None, name)) for name in names)


def is_read(parameter) -> bool:
    told = parameter.help or ""
    if any(words in told for words in NAMES_OR_FILES):
        return True
    is_path = type(parameter.type).__name__ == "TyperPath"
    return is_path and parameter.name not in WRITTEN and not told.startswith("Write")


READING = [
    pytest.param((path, command, parameter), id=f"{' '.join(path)} {parameter.name}")
    for path, command in sorted(commands(), key=lambda found: found[0])
    for parameter in command.params
    if is_read(parameter)
]


@pytest.fixture(scope="module")
def there(tmp_path_factory) -> Path:
    file = tmp_path_factory.mktemp("there") / "machine.json"
    file.write_text(json.dumps(experts_machine("support-1").to_document()))
    return file


def words_for(parameter, value: str) -> list[str]:
    return [value] if isinstance(parameter, TyperArgument) else [parameter.opts[0], value]


@pytest.fixture
def refusal(monkeypatch, capsys):
    """Runs a command that is refused, and has its exit code and what it says."""

    def run(*words: str) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["buildarena", *words])
        with pytest.raises(SystemExit) as ended:
            main.run()
        said = capsys.readouterr()
        assert not said.out
        return ended.value.code, said.err

    return run


@pytest.mark.parametrize("reading", READING)
def test_a_missing_file_is_named_in_one_sentence(reading, refusal, there, tmp_path) -> None:
    path, command, parameter = reading
    missing = str(tmp_path / "missing.yaml")
    others = {
        "task": "support-1",
        "model": "builtin/expert",
        "out": str(tmp_path / ("out.blv" if path == ("besiege", "level") else "out.json")),
        "video": str(tmp_path / "out.mp4"),
        "queue": "simulate.mujoco",
    }
    words = chain.from_iterable(
        words_for(one, missing if one is parameter else others.get(one.name, str(there)))
        for one in command.params
        if one is parameter or one.required
    )
    code, said = refusal(*path, *words)
    (line,) = said.splitlines()
    assert line.removeprefix("error: ") == f"{missing}: No such file or directory"
    assert code == 2
    assert not list(tmp_path.iterdir())


def test_every_command_that_reads_a_file_was_tried() -> None:
    tried = {" ".join(one.values[0][0]) for one in READING}
    assert tried >= {"sweep run", "machine simulate", "task add", "admin worker"}
    assert len(READING) >= 20


def test_a_file_with_a_login_that_is_not_there(refusal, tmp_path) -> None:
    code, said = refusal("admin", "roles", f"api={tmp_path / 'missing'}")
    assert code == 2
    assert f"{tmp_path / 'missing'} can't be read" in said
