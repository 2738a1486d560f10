"""One thread for linear algebra: faster for small systems, and the same bytes on any machine."""

from contextlib import AbstractContextManager
from functools import cache
from importlib import import_module
from typing import Any


def single_threaded() -> AbstractContextManager[object]:
    """While it is entered, NumPy's and SciPy's BLAS use one thread in this process.

    Sums over several threads depend on how many cores a machine has.
    """
    limits: AbstractContextManager[object] = _threads().limit(limits=1, user_api="blas")
    return limits


@cache
def _threads() -> Any:
    """The process's pools of threads; looking for them takes longer than a tick of a trial."""
    import_module("scipy.sparse.linalg")  # brings a BLAS of its own, to be limited as well
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
