"""Tries the network of hosts by itself; prints what was measured, and goes on until it is ended."""

import json
import signal
import socket
import sys
import time

from scenarios.hosts.network import PLACE, Network, address, enter_private_namespaces, inside

PORT = 7000


def seconds_for_an_echo(near: socket.socket, far: socket.socket) -> float:
    """From a byte's sending to the arrival of its answer; raises TimeoutError."""
    started = time.monotonic()
    near.sendall(b"?")
    far.sendall(far.recv(1))
    near.recv(1)
    return time.monotonic() - started


def main() -> None:
    """Measures."""
    enter_private_namespaces()
    network = Network(delay_s=0.05, rate="20mbit")
    with inside("database"):
        listener = socket.create_server((address("database"), PORT))
    with inside("runner"):
        near = socket.create_connection((address("database"), PORT), timeout=5)
    far, (caller, _) = listener.accept()
    for end in (near, far):
        end.settimeout(0.6)
        end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    found = {"caller": caller, "echo_s": seconds_for_an_echo(near, far)}
    network.take_down("runner")
    near.sendall(b"?")
    try:
        far.recv(1)
    except TimeoutError:
        found["cut"] = "silence"
    network.put_up("runner")
    far.settimeout(5)
    found["after"] = far.recv(1).decode()
    (PLACE / "left").touch()
    sys.stdout.write(json.dumps(found) + "\n")
    sys.stdout.flush()
    signal.pause()


if __name__ == "__main__":
    main()
