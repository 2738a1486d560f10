"""Where a benchmark's figures go."""

import json
import sys
from pathlib import Path
from typing import Any


def tell(figures: Any, file: Path | None) -> None:
    """Prints them, and keeps them."""
    sys.stdout.write(json.dumps(figures, indent=2) + "\n")
    keep(figures, file)


def keep(figures: Any, file: Path | None) -> None:
    """Writes them to the file that was asked for, if any."""
    if file is not None:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
