"""The dashboard's pages in a real browser: what they need, and how their tests are run."""

import os
import shutil
from pathlib import Path

import pytest
from support.marks import nightly
from support.programs import captured

from buildarena_api.dashboard import FOLDER

WEB = Path(__file__).resolve().parents[3] / "clients" / "web"
NODE = WEB.parents[1] / "mk" / "node.sh"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
MAX_S = 1200
"""What hangs is ended then; on a busy machine the pages take ten minutes."""

_ALL = nightly({"BUILDARENA_WEB_ALL_LOOKS": "1"}, id="all looks")
LOOKS = [_ALL, pytest.param({}, id="one look")]
"""Each page in one look; in all of them, wide and narrow, light and dark."""
needs_pages = [
    pytest.mark.skipif(
        CHROMIUM is None, reason="pages need a browser: install the Debian packages chromium"
    ),
    pytest.mark.skipif(
        not (FOLDER / "index.html").is_file() or not (WEB / "node_modules").is_dir(),
        reason="the dashboard has not been built: make web",
    ),
    pytest.mark.timeout(MAX_S + 120),
]


def in_browser(url: str, files: list[str], **environment: str) -> str:
    """Runs the browser's tests of some files.

    Args:
        url: The service's.
        files: Of `clients/web/e2e`, by how their paths begin.
        environment: What these files ask for.

    Returns:
        What they printed.
    """
    command = ["bash", str(NODE), "npm", "--prefix", str(WEB), "run", "--silent", "test:pages"]
    words = [*command, "--", *files, "--disable-console-intercept"]
    told = {"BUILDARENA_WEB_URL": url, "BUILDARENA_CHROMIUM": str(CHROMIUM), "NO_COLOR": "1"}
    own = {**os.environ, **environment, **told}
    done = captured(words, cwd=NODE.parents[1], env=own, within_s=MAX_S)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]
    return done.stdout
