"""What images install of the product's lock, as the recipe selects it."""

import re
import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[3]


def image_locks(folder: Path) -> dict[str, set[str]]:
    """Names of the distributions in each image.

    Args:
        folder: Where the recipe's program finds the sources and writes, new or empty.
    """
    folder.mkdir(exist_ok=True)
    shutil.copy(ROOT / "mk/locked.py", folder)
    shutil.copy(ROOT / "requirements.lock", folder)
    for project in ROOT.glob("*/*/pyproject.toml"):
        target = folder / project.relative_to(ROOT)
        target.parent.mkdir(parents=True)
        shutil.copy(project, target)
    program = ROOT / "deploy/docker/locks.sh"
    subprocess.run(["bash", program, folder / "locks"], cwd=folder, check=True)
    return {
        lock.stem: set(re.findall(r"^([a-z0-9._-]+)==", lock.read_text(), re.MULTILINE))
        for lock in (folder / "locks").glob("*.lock")
    }
