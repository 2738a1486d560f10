"""Wires between hosts and the switch: every frame arrives a while after it was sent.

`netem`, which does this in kernels that have it, is not in all of them. A proxy of connections
would not do: it ends every connection at itself, so that a link which is taken down would be
noticed by one side only. Frames leave both ends' TCP to themselves. Runs as a program:
``python wires.py DELAY_S FD:FD …`` with two open TAP devices for each wire.
"""

import fcntl
import os
import select
import struct
import sys
import time
from collections import deque
from contextlib import suppress

TUNSETIFF = 0x400454CA
TAP_WITHOUT_HEADER = 0x0002 | 0x1000
LONGEST_FRAME = 65_536


def open_tap(name: str) -> int:
    """Makes a network device of which this process is the other end; returns its descriptor."""
    tap = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(tap, TUNSETIFF, struct.pack("16sH22x", name.encode(), TAP_WITHOUT_HEADER))
    return tap


def carry(pairs: list[tuple[int, int]], delay_s: float) -> None:
    """Passes frames on between the two ends of each wire, until the process is ended."""
    other = {a: b for pair in pairs for a, b in (pair, pair[::-1])}
    poll = select.epoll()
    for tap in other:
        poll.register(tap, select.EPOLLIN)
    # The delay is the same for all frames, so they are due in the order in which they came.
    under_way: deque[tuple[float, int, bytes]] = deque()
    while True:
        wait_s = max(0.0, under_way[0][0] - time.monotonic()) if under_way else -1
        for tap, _ in poll.poll(wait_s):
            with suppress(OSError):  # all is read, or the device is down
                while True:
                    frame = os.read(tap, LONGEST_FRAME)
                    under_way.append((time.monotonic() + delay_s, other[tap], frame))
        now = time.monotonic()
        while under_way and under_way[0][0] <= now:
            _, tap, frame = under_way.popleft()
            with suppress(OSError):  # a device that is down takes nothing: the frame is lost
                os.write(tap, frame)


def main() -> None:
    """Carries frames between the devices that were passed on."""
    delay_s, *wires = sys.argv[1:]
    carry([(int(a), int(b)) for a, b in (wire.split(":") for wire in wires)], float(delay_s))


if __name__ == "__main__":
    main()
