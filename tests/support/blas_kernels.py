"""The kernels that the goldens were made with, wherever the processor has them.

A bridge's collapse amplifies the last bit of a sum, so the product pins its kernels as it is
imported; here it is imported before whatever else of the tests loads numpy.
"""

from buildarena_geometry import kernels

assert not kernels.LATE, "OpenBLAS has chosen its kernels already"
