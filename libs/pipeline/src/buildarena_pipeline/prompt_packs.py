"""Prompt packs: all sentences that a session says to a model, in a folder, with a hash.

A pack is a folder of Markdown files: ``planner.md`` … are the roles' system messages, files
under ``messages/`` are the frames of what the roles are told, with ``$name`` places.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from string import Template

from buildarena_pipeline.errors import StartupError

ROLES = ("planner", "drafter", "reviewer", "builder", "guidance", "controller", "solo")
MESSAGES = (
    "plan",
    "plan_again",
    "draft",
    "blueprint",
    "build",
    "build_solo",
    "refine",
    "assemble",
    "control",
    "control_again",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PromptPack:
    """The sentences of a session.

    Attributes:
        name: What submissions call it.
        digest: SHA-256 over all its files; part of every result.
        roles: System messages by role.
        messages: Frames by name.
    """

    name: str
    digest: str
    roles: Mapping[str, str]
    messages: Mapping[str, str]

    def say(self, message: str, **values: str) -> str:
        """A frame with its places filled."""
        return Template(self.messages[message]).substitute(values)


def builtin_folder() -> Path:
    """Where the packs that come with BuildArena lie."""
    return Path(str(resources.files("buildarena_pipeline"))) / "prompts"


def pack_names() -> list[str]:
    """Names of the packs that come with BuildArena."""
    return sorted(path.name for path in builtin_folder().iterdir() if path.is_dir())


@cache
def load_pack(name: str) -> PromptPack:
    """The pack with this name.

    Raises:
        StartupError: There is none, or a file is missing.
    """
    if name not in pack_names():
        raise StartupError(f"no prompt pack {name!r}; there are {', '.join(pack_names())}")
    return read_pack(builtin_folder() / name, name=name)


def read_pack(folder: Path, *, name: str) -> PromptPack:
    """Reads a pack from a folder.

    Raises:
        StartupError: A file is missing.
    """
    texts: dict[str, str] = {}
    for file in [*ROLES, *(f"messages/{message}" for message in MESSAGES)]:
        path = folder / f"{file}.md"
        try:
            texts[file] = path.read_text(encoding="utf-8").strip()
        except OSError as error:
            raise StartupError(f"prompt pack {name!r} lacks {path}") from error
    digest = hashlib.sha256()
    for file, text in sorted(texts.items()):
        digest.update(f"{file}\0{text}\0".encode())
    return PromptPack(
        name=name,
        digest=digest.hexdigest(),
        roles={role: texts[role] for role in ROLES},
        messages={message: texts[f"messages/{message}"] for message in MESSAGES},
    )
