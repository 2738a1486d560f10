"""Properties of this machine that can change the last bits of a trial."""

import platform
import warnings
from collections.abc import Mapping
from functools import cache
from typing import Any, Final

import numpy as np

from buildarena_geometry import kernels

_LEVELS: Final = (("X86_V4", "AVX512_SKX"), ("X86_V3", "AVX2"), ("X86_V2", "SSE42"))
"""numpy's levels of vector loops, best first: the name since 2.4, and an older feature."""


@cache
def processor() -> Mapping[str, str]:
    """Return the kernels of this process and other sources of rounding differences, for manifests.

    Returns:
        ``blas``: numpy's kernels of linear algebra, as OpenBLAS names them, or ``unknown``;
        ``numpy``: the level of its vector loops; ``machine``: the architecture; ``libm``: the
        library with sine and cosine.
    """
    from threadpoolctl import threadpool_info

    loaded = [
        str(library.get("architecture", "unknown"))
        for library in threadpool_info()
        if library.get("user_api") == "blas"
    ]
    return {
        "blas": loaded[0] if loaded else "unknown",
        "numpy": _level(),
        "machine": platform.machine(),
        "libm": " ".join(platform.libc_ver()) or platform.system(),
    }


@cache
def warn_if_late() -> None:
    """Warn once if numpy was loaded before the kernels were pinned and has others."""
    loaded = processor()["blas"]
    if kernels.LATE and kernels.PINNED not in {None, loaded}:
        warnings.warn(
            f"numpy was imported before buildarena, and computes with the kernels {loaded} in "
            f"place of {kernels.PINNED}: trials here may differ in their last bits from others. "
            "Import buildarena first",
            stacklevel=3,
        )


def _level() -> str:
    extensions: Mapping[str, Any] = np.show_config(mode="dicts")["SIMD Extensions"]
    features = [*extensions.get("baseline", ()), *extensions.get("found", ())]
    for level, feature in _LEVELS:
        if level in features or feature in features:
            return level
    return features[-1] if features else "unknown"
