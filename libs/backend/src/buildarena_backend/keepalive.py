"""TCP keepalive and timeout settings, which detect dead connections.

A cable that was cut or a machine that lost power closes no connection. Whoever waits for an answer
then waits for hours, by the defaults of TCP, and whoever sent something for a quarter of an hour.
"""

from __future__ import annotations

import socket
from collections.abc import Mapping, Sequence
from typing import Final

IDLE_S: Final = 5
"""Idle time after which the other end is probed."""
EVERY_S: Final = 3
PROBES: Final = 3
UNANSWERED_S: Final = 10
"""Time after which unacknowledged data ends the connection."""


def tcp_options(*, unanswered_s: int = UNANSWERED_S) -> Mapping[int, int]:
    """Return the options of a TCP socket that this system has, except SO_KEEPALIVE."""
    values = {
        "TCP_KEEPIDLE": IDLE_S,
        "TCP_KEEPALIVE": IDLE_S,  # its name on macOS
        "TCP_KEEPINTVL": EVERY_S,
        "TCP_KEEPCNT": PROBES,
        "TCP_USER_TIMEOUT": unanswered_s * 1000,
    }
    return {getattr(socket, name): value for name, value in values.items() if hasattr(socket, name)}


def socket_options(*, unanswered_s: int = UNANSWERED_S) -> Sequence[tuple[int, int, int]]:
    """Return all of them with their levels, as HTTP clients take them."""
    options = tcp_options(unanswered_s=unanswered_s).items()
    tcp = [(socket.IPPROTO_TCP, option, value) for option, value in options]
    return [(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1), *tcp]
