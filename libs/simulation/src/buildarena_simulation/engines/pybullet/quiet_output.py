"""Keeps what a C library prints on import out of our output."""

import contextlib
import ctypes
import os
import sys
from collections.abc import Iterator

_STREAMS = (1, 2)


@contextlib.contextmanager
def quiet_output() -> Iterator[None]:
    """Suppress everything that Python or C prints to stdout or stderr in this context."""
    sys.stdout.flush()
    sys.stderr.flush()
    copies = [os.dup(stream) for stream in _STREAMS]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for stream in _STREAMS:
            os.dup2(nowhere, stream)
        yield
        # What C has buffered must leave before the streams are put back.
        ctypes.CDLL(None).fflush(None)
    finally:
        for stream, copy in zip(_STREAMS, copies, strict=True):
            os.dup2(copy, stream)
            os.close(copy)
        os.close(nowhere)
