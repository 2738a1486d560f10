"""Runs what a document shows, word for word, and compares what it says it prints."""

import contextlib
import io
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from support.programs import captured

_FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


class Shown(NamedTuple):
    """A block of code, and the output that the document shows after it, if it does."""

    language: str
    code: str
    output: str | None


def shown_in(document: Path) -> Iterator[Shown]:
    """The blocks of code of a document; a block called `output` belongs to the one before it."""
    blocks = _FENCE.findall(document.read_text(encoding="utf-8"))
    for number, (language, code) in enumerate(blocks):
        if language == "output":
            assert number > 0, "an output needs code before it"
            continue
        follows = blocks[number + 1] if number + 1 < len(blocks) else ("", "")
        yield Shown(language, code, follows[1] if follows[0] == "output" else None)


def run_document(document: Path, *, environment: Mapping[str, str], folder: Path) -> int:
    """Runs all blocks of Python, in one namespace, and of bash, in a folder, in their order."""
    names: dict[str, Any] = {"__name__": "__main__"}
    count = 0
    for language, code, output in shown_in(document):
        if language == "python":
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed):
                exec(compile(code, str(document), "exec"), names)
            said = printed.getvalue()
        elif language == "bash":
            said = _command(code, environment, folder)
        else:
            continue
        count += 1
        assert output is None or said == output, f"{code}\nprints\n{said}\nand not\n{output}"
    return count


def _command(code: str, environment: Mapping[str, str], folder: Path) -> str:
    words = ["bash", "-euo", "pipefail", "-c", code]
    done = captured(words, env=dict(environment), cwd=folder, within_s=200)
    assert done.returncode == 0, f"{code}\n{done.stdout}\n{done.stderr}"
    return done.stdout
