"""Commands of the command line, run in the test's process: one of their own takes seconds."""

from dataclasses import dataclass

from typer.testing import CliRunner

from buildarena_cli.errors import CommandError
from buildarena_cli.main import app


@dataclass(frozen=True)
class Done:
    """How a command ended."""

    returncode: int
    stdout: str
    stderr: str


def run(*words: str, **environment: str) -> Done:
    """Runs a command as it is, with further variables of the environment."""
    result = CliRunner().invoke(app, [*words], env={"COLUMNS": "100", **environment})
    if isinstance(result.exception, CommandError):
        return Done(result.exception.code, result.stdout, str(result.exception))
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return Done(result.exit_code, result.stdout, result.stderr)


def run_cli(url: str, *words: str) -> Done:
    """Runs a command against a service."""
    return run(*words, "--url", url)


def printed(url: str, *words: str) -> str:
    """What a command prints that ends well."""
    done = run_cli(url, *words)
    assert done.returncode == 0, done.stderr
    return done.stdout
