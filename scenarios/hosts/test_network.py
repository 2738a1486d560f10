"""The network that `make test-hosts` makes: slow, cut without a word, and gone with its maker."""

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest
from support.servers.stacks import wait_until

pytestmark = pytest.mark.nightly

ROOT = Path(__file__).parents[2]
PROGRAMS = ("ip", "tc", "unshare")


def require_namespaces() -> None:
    if os.geteuid() != 0:
        pytest.skip("only root can make network namespaces")
    missing = [name for name in PROGRAMS if shutil.which(name) is None]
    if missing:
        pytest.skip(f"install the Debian packages iproute2 and util-linux: no {missing}")
    tried = subprocess.run(["unshare", "--net", "--mount", "--pid", "--fork", "true"], check=False)
    if tried.returncode or not Path("/dev/net/tun").exists():
        pytest.skip("this machine makes no network namespaces, or has no /dev/net/tun")


def devices() -> set[str]:
    return {file.name for file in Path("/sys/class/net").iterdir()}


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_links_are_slow_and_cut_and_nothing_is_left(how) -> None:
    require_namespaces()
    before = devices()
    program = [sys.executable, "-m", "scenarios.hosts.try_network"]
    with subprocess.Popen(
        program, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True, cwd=ROOT
    ) as process:
        try:
            found = json.loads(process.stdout.readline())
            family = psutil.Process(process.pid).children(recursive=True)
            assert len(family) >= 2
            assert devices() == before
            assert not Path("/run/hosts").exists()
        finally:
            # As a terminal does it: to all that it started.
            (os.kill if how == signal.SIGKILL else os.killpg)(process.pid, how)
    assert found["caller"] == "10.213.0.50"
    assert 0.1 <= found["echo_s"] < 0.5
    assert (found["cut"], found["after"]) == ("silence", "?")
    wait_until(lambda: not any(one.is_running() for one in family), 5, "its processes are gone")
    assert devices() == before
    assert not Path("/run/hosts").exists()


def test_others_than_root_are_told_what_is_needed() -> None:
    try_it = "from scenarios.hosts import network as n; n.os.geteuid = "
    try_it += "lambda: 1000; n.enter_private_namespaces()"
    done = subprocess.run(
        [sys.executable, "-c", try_it], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "run it as root" in done.stderr
