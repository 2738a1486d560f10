"""One thread for linear algebra: faster for small systems, and the same bytes on any machine."""

from contextlib import AbstractContextManager
from importlib import import_module


def single_threaded() -> AbstractContextManager[object]:
    """While it is entered, NumPy's and SciPy's BLAS use one thread in this process.

    Sums over several threads depend on how many cores a machine has.
    """
    import_module("scipy.sparse.linalg")  # brings a BLAS of its own, to be limited as well
    from threadpoolctl import threadpool_limits

    limits: AbstractContextManager[object] = threadpool_limits(limits=1, user_api="blas")
    return limits
