"""One set of BLAS kernels for all tests, whichever processor runs them.

OpenBLAS picks its kernels when numpy is imported, by the processor or by OPENBLAS_CORETYPE, and
they round differently. A bridge's collapse amplifies the last bit: the goldens were made with the
kernels pinned here. Importing this module pins them for this process and its children, so it
comes before numpy.
"""

import os
import sys
from pathlib import Path

_PROCESSOR = Path("/proc/cpuinfo")

assert "numpy" not in sys.modules, "OpenBLAS has chosen its kernels already"
if _PROCESSOR.exists() and " avx512f " in _PROCESSOR.read_text():
    os.environ["OPENBLAS_CORETYPE"] = "SkylakeX"
