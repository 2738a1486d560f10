"""Programs that are run to their end."""

import subprocess
from collections.abc import Sequence
from typing import Any


def captured(
    words: Sequence[str], *, within_s: float = 200, **given: Any
) -> subprocess.CompletedProcess[str]:
    """Runs a program; its exit code, and what it wrote."""
    given |= {"capture_output": True, "text": True, "timeout": within_s}
    return subprocess.run(words, check=False, **given)
