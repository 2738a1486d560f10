"""Linear algebra kernels of numpy; importing this module pins them for the process.

OpenBLAS chooses its kernels when numpy loads it, by the processor or by ``OPENBLAS_CORETYPE``, and
numpy its own vector loops, by the processor or by ``NPY_DISABLE_CPU_FEATURES``. Kernels differ in
the order of sums, so in the last bit, and a trial amplifies it. What is pinned, whatever those
variables say, is `USUAL`, so that all processors since 2013 agree, or what
``BUILDARENA_BLAS_KERNELS`` names: so that a trial is repeated as it was run elsewhere. Child
processes inherit it. This module must come before numpy.
"""

import os
import sys
import warnings
from collections.abc import Mapping, MutableMapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType
from typing import Final

CHOICE: Final = "BUILDARENA_BLAS_KERNELS"
"""The variable that names other kernels than the usual ones."""

LADDER: Final[Mapping[str, frozenset[str]]] = MappingProxyType(
    {
        "SkylakeX": frozenset({"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}),
        "Haswell": frozenset({"avx2", "fma"}),
        "Sandybridge": frozenset({"avx"}),
        "Nehalem": frozenset({"sse4_2"}),
    }
)
"""Kernels of x86-64 as OpenBLAS names them, best first, with the flags a processor must have.

They are those in the wheels of numpy and scipy, without the one for processors that numpy no longer
runs on.
"""

USUAL: Final = "Haswell"
"""What is pinned wherever the processor has it; an older one has the first that it can run."""

_PROCESSOR: Final = Path("/proc/cpuinfo")
_WIDER: Final = (
    "X86_V4 AVX512_ICL AVX512_SPR",
    "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL",
)
"""Features of numpy since 2.4, and before, that a processor without AVX-512 lacks."""
_WIDE: Final = (" X86_V3", " AVX2 FMA3")
"""The same of a processor without AVX2."""


def runnable(processor: Path = _PROCESSOR) -> tuple[str, ...]:
    """Return the names of the kernels that the processor can run, best first.

    Args:
        processor: File with the system's description of it. Without one, as on ARM and Windows, no
            kernels are named.
    """
    flags: set[str] = set()
    if processor.exists():
        with processor.open(encoding="utf-8") as lines:
            line = next((line for line in lines if line.startswith("flags")), "")
        flags = set(line.partition(":")[2].split())
    return tuple(name for name, needed in LADDER.items() if needed <= flags)


def pin(environment: MutableMapping[str, str], names: tuple[str, ...]) -> str | None:
    """Pin the kernels of a process that starts with this environment.

    Args:
        environment: Environment to write to; a choice in it takes precedence.
        names: Kernels that the processor can run, best first.

    Returns:
        The kernels; None where none are known, and OpenBLAS chooses. A choice that is not among
        the names leaves the usual ones, with a warning.
    """
    chosen = environment.get(CHOICE) or None
    if chosen is not None and chosen not in names:
        choices = (
            ", ".join(names) or "none, its processor is not of x86-64 or the system says nothing"
        )
        warnings.warn(f"{CHOICE} is {chosen!r}; this machine runs {choices}", stacklevel=2)
        chosen = None
    chosen = chosen or (USUAL if USUAL in names else next(iter(names), None))
    if chosen is None:
        return None
    environment["OPENBLAS_CORETYPE"] = chosen
    environment.pop("NPY_ENABLE_CPU_FEATURES", None)
    environment.pop("NPY_DISABLE_CPU_FEATURES", None)
    disabled = _disabled(chosen)
    if disabled and chosen != names[0]:
        environment["NPY_DISABLE_CPU_FEATURES"] = disabled
    return chosen


def _disabled(kernels: str) -> str:
    """Return the processor features that numpy must avoid to compute as with these kernels."""
    if kernels == "SkylakeX":
        return ""
    try:
        before = tuple(int(part) for part in version("numpy").split(".")[:2]) < (2, 4)
    except (PackageNotFoundError, ValueError):
        before = False
    return _WIDER[before] + ("" if kernels == "Haswell" else _WIDE[before])


LATE: Final = "numpy" in sys.modules
"""Whether numpy was loaded first: only child processes then have the pinned kernels for certain."""

PINNED: Final = pin(os.environ, runnable())
"""The pinned kernels; None where OpenBLAS chooses."""
