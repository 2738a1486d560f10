"""Writes the asynchronous client from the synchronous one, so that both say and do the same.

``async_client.py`` writes all modules; their text is that of `asynchronous(MODULE)`.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path
from typing import Final

PACKAGE: Final = Path(__file__).parents[1] / "src" / "buildarena_client"
SOURCE: Final = PACKAGE / "synchronous"
TARGET: Final = PACKAGE / "asynchronous"
MODULES: Final = ("sending", "boards", "catalogue", "jobs", "sessions", "sweeps", "client")
"""All but the wire, which each client has of its own."""
PURE: Final = {"__init__", "__repr__", "_reading", "_unreachable"}
"""Methods that send nothing."""
CLASSES: Final = ("Sender", "Client", "Wire", "Boards", "Catalogue", "Jobs", "Sessions", "Sweeps")
GENERATED: Final = "Generated from the synchronous module: `make openapi` writes this file."


def _class_names(line: re.Match[str]) -> str:
    return re.sub(rf"\b({'|'.join(CLASSES)})\b", r"Async\1", line[0])


WORDS: Final = (
    (r"(?:^class|.* import|.*self\._wire =) .*", _class_names),
    (r"buildarena_client\.synchronous\b", "buildarena_client.asynchronous"),
    (r"\b(Iterator|Generator)\b", r"Async\1"),
    (r"\[(.*), None, None\]", r"[\1, None]"),
    (r"\btime\.sleep\(", "await asyncio.sleep("),
    (r"^import (contextlib|time)$", r"import asyncio\nimport \1"),
    (r"\bwith contextlib\.closing\(", "async with contextlib.aclosing("),
    (r"  # noqa: (SIM117|UP028) .*", ""),
    (r"\b__(enter|exit)__\b", r"__a\1__"),
    (r"(self\._wire\.(send|close)\(|(?<== )answer\.read\()", r"await \1"),
    (r"with self\._wire\.opened\(", "async with self._wire.opened("),
    (r"for chunk in (answer\.chunks|chunks)", r"async for chunk in \1"),
    (r'\A"""(.*?)"""', f'"""\\1\n\n{GENERATED}\n"""'),
)
"""Patterns and what takes their place, in this order."""
DIFFERING: Final = (
    (
        "        patience: Patience | None = None,\n",
        "        patience: Patience | None = None,\n        at_once: int = AT_ONCE,\n",
    ),
    (
        "        patience: How long requests are sent again.\n",
        (
            "        patience: How long requests are sent again.\n"
            "        at_once: Requests that are open at most; further ones wait. Downloads and\n"
            "            streams are not counted.\n"
        ),
    ),
    ("AsyncWire(self.url, headers)", "AsyncWire(self.url, headers, at_once=at_once)"),
    (
        "RESTART_POLL_S: Final = 0.5\n",
        (
            "RESTART_POLL_S: Final = 0.5\nAT_ONCE: Final = 16\n"
            '"""Of one caller, the service has 96 requests open at most."""\n'
        ),
    ),
)
"""What the sender has besides."""


def asynchronous(module: str) -> str:
    """The asynchronous form of a module.

    Raises:
        ValueError: The synchronous one no longer says what is replaced.
    """
    text = (SOURCE / f"{module}.py").read_text(encoding="utf-8")
    streams, delegating, waiting = _methods()
    plain = "|".join(sorted(PURE | delegating))
    text = re.sub(rf"^    def (?!({plain})\()(?=\w+\()", "    async def ", text, flags=re.MULTILINE)
    text = re.sub(rf"\bself\.({'|'.join(sorted(waiting))})\(", r"await self.\1(", text)
    found = "|".join(sorted(streams | delegating))
    text = re.sub(rf"\bfor (\w+) in self\.({found})\(", r"async for \1 in self.\2(", text)
    for pattern, instead in WORDS:
        text = re.sub(pattern, instead, text, flags=re.MULTILINE)
    for old, new in DIFFERING if module == "sending" else ():
        if text.count(old) != 1:
            raise ValueError(f"{module}.py does not say once: {old}")
        text = text.replace(old, new)
    return _formatted(text, module)


def _methods() -> tuple[set[str], set[str], set[str]]:
    """Names of methods: those that yield, those that return what yields, and those that wait."""
    streams, delegating, waiting = set(), set(), set()
    for module in MODULES:
        tree = ast.parse((SOURCE / f"{module}.py").read_text(encoding="utf-8"))
        classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
        for method in [node for found in classes for node in found.body]:
            if not isinstance(method, ast.FunctionDef) or method.name in PURE:
                continue
            if any(isinstance(node, ast.Yield) for node in ast.walk(method)):
                streams.add(method.name)
            elif method.returns is not None and "Iterator[" in ast.unparse(method.returns):
                delegating.add(method.name)
            else:
                waiting.add(method.name)
    return streams, delegating, waiting


def _formatted(text: str, module: str) -> str:
    ruff = str(Path(sys.executable).with_name("ruff"))
    name = ["--quiet", "--stdin-filename", str(TARGET / f"{module}.py"), "-"]
    for words in (["check", "--select", "I,F401", "--fix-only"], ["format"]):
        text = subprocess.run(
            [ruff, *words, *name], input=text, capture_output=True, text=True, check=True
        ).stdout
    return text


if __name__ == "__main__":
    for each in MODULES:
        (TARGET / f"{each}.py").write_text(asynchronous(each), encoding="utf-8")
