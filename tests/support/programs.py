"""Programs that are run to their end."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from buildarena_backend.settings import Settings


def variables_of(settings: Settings, **more: object) -> dict[str, str]:
    """The environment of a process with the settings' database, broker and folder."""
    urls = {"database_url": settings.required_database_url()}
    urls["broker_url"] = settings.required_broker_url()
    named = {**urls, "data": settings.data, **more}
    return {f"BUILDARENA_{name.upper()}": str(value) for name, value in named.items()}


def captured(
    words: Sequence[str], *, within_s: float = 200, **given: Any
) -> subprocess.CompletedProcess[str]:
    """Runs a program; its exit code, and what it wrote."""
    given |= {"capture_output": True, "text": True, "timeout": within_s}
    return subprocess.run(words, check=False, **given)
