"""The command itself: what it loads, and what it refuses with one sentence and the right code."""

import json
import os
import socket
import subprocess
import sys

import psutil
import pytest
from support.clients.terminals import piped
from support.programs import captured

from buildarena import __version__
from buildarena_cli import main

HEAVY = {
    *("buildarena_backend", "buildarena_backend", "buildarena_simulation", "buildarena_geometry"),
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
SHELLS = ("bash", "zsh", "fish")
NOWHERE = "http://127.0.0.1:1"


def loaded_by(*words: str, **environment: str) -> set[str]:
    command, given = [sys.executable, "-c", LOADED, *words], {**os.environ, **environment}
    done = captured(command, env=given)
    return set(json.loads(done.stderr.rpartition("LOADED")[2]))


def completing(shell: str, line: str) -> dict[str, str]:
    told = {"COMP_WORDS": line, "COMP_CWORD": str(line.count(" ")), "_TYPER_COMPLETE_ARGS": line}
    told |= {"_TYPER_COMPLETE_FISH_ACTION": "get-args", "BUILDARENA_URL": NOWHERE}
    return {"_BUILDARENA_COMPLETE": f"complete_{shell}", **told}


@pytest.mark.nightly(keep=3)
@pytest.mark.parametrize(
    "words", [["--help"], *([name, "--help"] for name in ("sweep", "machine", "admin", "export"))]
)
def test_help_loads_no_library_that_it_does_not_need(words) -> None:
    assert loaded_by(*words) & {*HEAVY, "ssl"} == set()


def test_completion_and_asking_the_api_load_none_either() -> None:
    assert loaded_by(**completing("bash", "buildarena job show ")) & {*HEAVY, "ssl"} == set()
    for words in (["job", "list"], ["leaderboard"]):
        assert loaded_by(*words, "--url", NOWHERE) & HEAVY == set()


def test_the_first_page_lists_commands_in_five_groups_and_the_version() -> None:
    shown = piped("--help").stdout
    titles = [line[:-1] for line in shown.splitlines() if line.endswith(":")][1:]
    assert titles == ["Start", "Evaluate", "Look", "Extend", "Operate"]
    assert shown.index("Evaluate:") < shown.index("  sweep  ") < shown.index("Look:")
    assert piped("--version").stdout.strip() == __version__


def test_each_shell_is_offered_commands_and_options() -> None:
    for shell, line, word in zip(
        SHELLS,
        ("buildarena swe", "buildarena sweep wat", "buildarena job list --rea"),
        ("sweep", "watch", "--reason"),
        strict=True,
    ):
        assert word in piped(**completing(shell, line)).stdout, line
        script = piped(_BUILDARENA_COMPLETE=f"source_{shell}").stdout
        assert f"_BUILDARENA_COMPLETE=complete_{shell}" in script


# Refusals


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


def test_a_usage_error_names_the_near_words_and_ends_with_code_2(refusal, subtests) -> None:
    for words, says in (
        (["leaderbord"], "Did you mean 'leaderboard'?"),
        (["sweep", "wacth"], "Did you mean 'watch'?"),
        (["job", "list", "--taks", "x"], "--task"),
        (["job", "show"], "Missing argument 'job_id'"),
    ):
        with subtests.test(words=words):
            code, said = refusal(*words)
            assert (code, says in said) == (2, True), said


def assert_refused(done: subprocess.CompletedProcess[str], *words: str) -> None:
    assert done.returncode == 1, (done.stdout, done.stderr)
    (line,) = done.stderr.strip().splitlines()
    assert [word for word in words if word not in line] == []


@pytest.mark.ci
def test_what_cannot_start_is_refused_in_words_and_leaves_nothing(tmp_path, subtests) -> None:
    (tmp_path / "file").write_text("in the way")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        for command, data, words, says in (
            ("up", "new", ["--port", port], [port, "choose another port with --port"]),
            ("demo", "new", ["--port", port], [port, "choose another port with --port"]),
            ("up", "file/data", [], ["can't be written", "choose another with --data"]),
            ("demo", "file/data", [], ["can't be written", "choose another with --data"]),
        ):
            with subtests.test(command=command, says=says):
                done = piped(command, "--data", str(tmp_path / data), *words)
                assert_refused(done, *says)
    processes = [str(process.info["cmdline"]) for process in psutil.process_iter(["cmdline"])]
    assert not [process for process in processes if str(tmp_path) in process]


def test_no_service_and_a_port_that_is_no_port() -> None:
    done = piped("leaderboard", "--url", NOWHERE)
    assert_refused(done, f"no BuildArena answers at {NOWHERE}", "buildarena up")
    assert_refused(piped("up", BUILDARENA_PORT="99999"), "BUILDARENA_PORT", "99999")


# A file that is not there is one sentence and a usage error, whichever command it is given to


def test_a_missing_file_is_named_in_one_sentence(refusal, tmp_path, subtests) -> None:
    missing, out = str(tmp_path / "missing.yaml"), str(tmp_path / "out.json")
    for words in (
        ["sweep", "run", missing],
        ["task", "add", missing],
        ["task", "check", missing],
        ["machine", "check", missing],
        ["machine", "export", missing, "--out", out],
        ["machine", "simulate", missing, "--task", "support-1"],
    ):
        with subtests.test(words=words):
            code, said = refusal(*words)
            (line,) = said.splitlines()
            assert line.removeprefix("error: ") == f"{missing}: No such file or directory"
            assert (code, list(tmp_path.iterdir())) == (2, [])
    code, said = refusal("admin", "roles", f"api={missing}")
    assert (code, f"{missing} can't be read" in said) == (2, True)
