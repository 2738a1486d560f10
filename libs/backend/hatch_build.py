"""Refuses to build where a checkout turned the link to the migrations into a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

LINK = Path(__file__).parent / "src" / "buildarena_backend" / "migrations"


class MigrationsHook(BuildHookInterface):  # type: ignore[type-arg]
    """Check for the migrations before anything is packed."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Raise RuntimeError where they are missing."""
        del version, build_data
        if not (LINK / "env.py").is_file():
            raise RuntimeError(
                f"{LINK} is no link to the folder migrations: check out with symbolic links "
                "(git config core.symlinks true, then git checkout -- libs/backend)"
            )
