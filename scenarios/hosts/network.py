"""Network namespaces as hosts, on a switch whose links can be taken down.

All of it lies inside one private set of namespaces (network, mounts, processes), which ends with
the program that made it, even by kill -9: nothing is left, and nothing outside can be reached.
"""

import ctypes
import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from scenarios.hosts.wires import open_tap

HERE = Path(__file__).parent
INSIDE = "BUILDARENA_TEST_HOSTS_INSIDE"
PLACE = Path("/run/hosts")
"""In a file system of memory that ends with the namespaces."""
NETWORK = "10.213.0"
HOSTS = {"database": 10, "api": 20, "construct": 30, "simulator": 40, "runner": 50}
"""Hosts, and the last parts of their addresses."""
BURST, QUEUE = "32kb", "400ms"
CLONE_NEWNET, CLONE_NEWUTS = 0x40000000, 0x04000000
_libc = ctypes.CDLL(None, use_errno=True)


def address(host: str) -> str:
    """A host's address."""
    return f"{NETWORK}.{HOSTS[host]}"


def enter_private_namespaces() -> None:
    """Starts this program again inside namespaces of its own, unless it is there already."""
    if os.environ.get(INSIDE):
        _run("mount", "-t", "tmpfs", "-o", "mode=755", "none", "/run")
        PLACE.mkdir(mode=0o755)
        (PLACE / "tmp").mkdir()
        (PLACE / "tmp").chmod(0o1777)
        os.environ["TMPDIR"] = str(PLACE / "tmp")
        return
    if os.geteuid() != 0:
        sys.exit("make test-hosts: only root can make network namespaces; run it as root")
    for program, package in (("ip", "iproute2"), ("tc", "iproute2"), ("unshare", "util-linux")):
        if shutil.which(program) is None:
            sys.exit(f"make test-hosts: there is no `{program}`: install the package {package}")
    if not Path("/dev/net/tun").exists():
        sys.exit("make test-hosts: this kernel has no /dev/net/tun, which the wires are made of")
    words = [
        "--net",
        "--mount",
        "--pid",
        "--uts",
        "--ipc",
        "--fork",
        "--kill-child",
        "--mount-proc",
    ]
    os.environ[INSIDE] = "1"
    sys.stdout.flush()
    os.execvp("unshare", ["unshare", *words, *sys.orig_argv])


def _run(*words: str) -> None:
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(words)}: {done.stderr.strip()}")


def move_into(host: str) -> None:
    """Moves the calling thread, and what it starts from now on, to a host for good."""
    with (Path("/run/netns") / host).open() as namespace:
        _require(_libc.setns(namespace.fileno(), CLONE_NEWNET))


@contextmanager
def inside(host: str) -> Iterator[None]:
    """On a host: programs, threads and sockets that are made in the block stay there."""
    with Path("/proc/thread-self/ns/net").open() as home:
        move_into(host)
        try:
            yield
        finally:
            _require(_libc.setns(home.fileno(), CLONE_NEWNET))


def named(host: str) -> Callable[[], None]:
    """What a child calls to have a host's name."""

    def prepare() -> None:
        _require(_libc.unshare(CLONE_NEWUTS))
        socket.sethostname(host)

    return prepare


def _require(result: int) -> None:
    if result != 0:
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))


class Network:
    """The switch, its wires and hosts; this process itself stands at the switch.

    Args:
        delay_s: From any host to any other.
        rate: Of each link in each direction, as `tc` spells it.
    """

    def __init__(self, *, delay_s: float, rate: str) -> None:
        _run("ip", "link", "set", "lo", "up")
        _run("ip", "link", "add", "switch", "type", "bridge")
        _run("ip", "addr", "add", f"{NETWORK}.1/24", "dev", "switch")
        _run("ip", "link", "set", "switch", "up")
        taps = [self._connect(host, rate) for host in HOSTS]
        words = [f"{a}:{b}" for a, b in taps]
        self._wires = subprocess.Popen(
            [sys.executable, str(HERE / "wires.py"), str(delay_s / 2), *words],
            pass_fds=[tap for pair in taps for tap in pair],
            start_new_session=True,
        )
        for pair in taps:
            for tap in pair:
                os.close(tap)

    def _connect(self, host: str, rate: str) -> tuple[int, int]:
        here, there = f"to-{host}", f"at-{host}"
        ends = open_tap(there), open_tap(here)
        _run("ip", "netns", "add", host)
        _run("ip", "link", "set", there, "netns", host, "name", "eth0")
        _run("ip", "-n", host, "link", "set", "lo", "up")
        _run("ip", "-n", host, "addr", "add", f"{address(host)}/24", "dev", "eth0")
        _run("ip", "-n", host, "link", "set", "eth0", "up")
        _run("ip", "link", "set", here, "master", "switch", "up")
        limit = ["root", "tbf", "rate", rate, "burst", BURST, "latency", QUEUE]
        _run("tc", "-n", host, "qdisc", "add", "dev", "eth0", *limit)
        _run("tc", "qdisc", "add", "dev", here, *limit)
        return ends

    def take_down(self, host: str) -> None:
        """Cuts a host's link: frames are lost, and nobody is told."""
        _run("ip", "link", "set", f"to-{host}", "down")

    def put_up(self, host: str) -> None:
        """Mends a host's link."""
        _run("ip", "link", "set", f"to-{host}", "up")

    def require_wires(self) -> None:
        """Checks that the wires still carry."""
        assert self._wires.poll() is None, "the wires have ended"

    def close(self) -> None:
        """Ends wires and hosts."""
        self._wires.kill()
        self._wires.wait()
        for host in HOSTS:
            subprocess.run(["ip", "netns", "del", host], check=False, capture_output=True)
