"""What images install of the product's lock, as the recipe selects it."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]


def image_lock_names(folder: Path) -> set[str]:
    """Names of the distributions in the images.

    Args:
        folder: Where the recipe's program finds the sources, new or empty.
    """
    folder.mkdir(exist_ok=True)
    shutil.copy(ROOT / "mk/locked.py", folder)
    shutil.copy(ROOT / "requirements.lock", folder)
    for project in ROOT.glob("*/*/pyproject.toml"):
        target = folder / project.relative_to(ROOT)
        target.parent.mkdir(parents=True)
        shutil.copy(project, target)
    recipe = (ROOT / "deploy/docker/Dockerfile").read_text().replace("\\\n", " ")
    (words,) = re.findall(r"locked\.py (requirements\.lock services.*?) >", recipe)
    done = subprocess.run(
        [sys.executable, "locked.py", *words.split()],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    return set(re.findall(r"^([a-z0-9._-]+)==", done.stdout, re.MULTILINE))
