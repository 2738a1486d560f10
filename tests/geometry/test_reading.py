"""Typed values that threads read at once; what it would cost is the process, so it has its own."""

import subprocess
import sys

FIRST_READS = """
import sys
import threading

import msgspec

from buildarena_geometry.errors import DocumentError
from buildarena_geometry.reading import Form, read

THREADS, ROUNDS, FIELDS = 8, 50, 30
sys.setswitchinterval(1e-6)


def fresh():
    kinds = {"bases": (Form,), "frozen": True, "kw_only": True}
    numbers = [(f"n{i}", dict[str, tuple[float, ...]]) for i in range(FIELDS)]
    inner = msgspec.defstruct("Inner", numbers, **kinds)
    return msgspec.defstruct("Outer", [(f"f{i}", list[inner]) for i in range(FIELDS)], **kinds)


inner = {f"n{i}": {"a": [1.0]} for i in range(FIELDS)}
value = {f"f{i}": [inner] for i in range(FIELDS)}
for _ in range(ROUNDS):
    kind, together, whole = fresh(), threading.Barrier(THREADS), []

    def go():
        together.wait()
        whole.append(read(value, kind, where="value", error=DocumentError))

    threads = [threading.Thread(target=go) for _ in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(whole) == THREADS and all(one == whole[0] for one in whole)
"""


def test_threads_may_be_the_first_to_read_a_form_together() -> None:
    subprocess.run([sys.executable, "-c", FIRST_READS], check=True)
