"""Prompt packs: all texts that a session sends to a model, in a folder, with a hash.

A pack is a folder of Markdown files: ``planner.md`` … are the roles' system messages, files under
``messages/`` are the frames of what the roles read, with ``$name`` places.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from string import Template

from buildarena_backend.errors import StartupError


@dataclass(frozen=True, slots=True, kw_only=True)
class PromptPack:
    """The texts of a session.

    Attributes:
        digest: SHA-256 over all its sentences; part of every result.
        roles: System messages by role.
        messages: Frames by name.
    """

    name: str
    digest: str
    roles: Mapping[str, str]
    messages: Mapping[str, str]

    def say(self, message: str, **values: str) -> str:
        """Return a frame with its places filled."""
        return Template(self.messages[message]).substitute(values)


class PromptPacks:
    """The packs that come with BuildArena and those of an operator's folder.

    Args:
        folder: Operator's folder with one folder per pack, if any.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._folders = _packs_in(builtin_folder())
        if folder is not None:
            try:
                self._folders |= _packs_in(folder)
            except OSError as error:
                raise StartupError(f"prompt packs {folder}: {error.strerror}") from error
        self._read: dict[str, PromptPack] = {}

    @property
    def names(self) -> list[str]:
        """Names of all packs."""
        return sorted(self._folders)

    def load(self, name: str) -> PromptPack:
        """Return the pack with this name, read once.

        Raises:
            StartupError: The pack does not exist, or a file of it can't be used.
        """
        if name not in self._folders:
            raise StartupError(f"no prompt pack {name!r}; there are {', '.join(self.names)}")
        if name not in self._read:
            self._read[name] = read_pack(self._folders[name], name=name)
        return self._read[name]


def builtin_folder() -> Path:
    """Return the folder of the built-in packs."""
    return Path(str(resources.files("buildarena_backend.catalog"))) / "prompts"


def _packs_in(folder: Path) -> dict[str, Path]:
    return {path.name: path for path in folder.iterdir() if path.is_dir()}


def read_pack(folder: Path, *, name: str) -> PromptPack:
    """Read a pack from a folder.

    Raises:
        StartupError: A file is missing.
    """
    # Every pack has the files that the built-in one has.
    complete = builtin_folder() / "default"
    roles = {file.stem: _text(folder, file.name, name) for file in complete.glob("*.md")}
    messages = {
        file.stem: _text(folder, f"messages/{file.name}", name)
        for file in (complete / "messages").glob("*.md")
    }
    digest = hashlib.sha256()
    for kind, texts in (("role", roles), ("message", messages)):
        for key, text in sorted(texts.items()):
            digest.update(f"{kind}\0{key}\0{text}\0".encode())
    return PromptPack(name=name, digest=digest.hexdigest(), roles=roles, messages=messages)


def _text(folder: Path, file: str, name: str) -> str:
    path = folder / file
    try:
        return path.read_text(encoding="utf-8").strip()
    except OSError as error:
        raise StartupError(f"prompt pack {name!r} lacks {path}") from error
