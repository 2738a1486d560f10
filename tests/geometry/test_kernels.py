"""Kernels are pinned by what the processor has, whatever other variables say."""

import ast
from functools import cache
from pathlib import Path

import pytest

from buildarena_geometry import kernels

ROOT = Path(__file__).parents[2]
AVX2 = "sse4_2 avx avx2 fma"
AVX512 = f"{AVX2} avx512f avx512bw avx512cd avx512dq avx512vl"
NUMERIC = {"numpy", "scipy", "fcl", "mujoco", "pybullet"}
PACKAGES = sorted(ROOT.glob("libs/*/src/*")) + sorted(ROOT.glob("services/*/src/*"))


def test_a_processor_has_the_kernels_whose_flags_it_has(tmp_path, subtests) -> None:
    for flags, names in [
        (AVX512, ("SkylakeX", "Haswell", "Sandybridge", "Nehalem")),
        (AVX512.replace(" avx512vl", ""), ("Haswell", "Sandybridge", "Nehalem")),
        (AVX2, ("Haswell", "Sandybridge", "Nehalem")),
        ("sse4_2 avx", ("Sandybridge", "Nehalem")),
        ("sse4_2", ("Nehalem",)),
        ("", ()),
    ]:
        with subtests.test(flags=flags):
            described = tmp_path / "cpuinfo"
            described.write_text(f"processor : 0\nflags\t\t: fpu {flags} ht\nprocessor : 1\n")
            assert kernels.runnable(described) == names


def test_a_system_that_does_not_describe_its_processor_leaves_the_choice(tmp_path) -> None:
    described = tmp_path / "cpuinfo"
    assert kernels.runnable(described) == ()
    described.write_text("Features : fp asimd\n")
    assert kernels.runnable(described) == ()
    environment = {"OPENBLAS_CORETYPE": "NEOVERSEN1"}
    assert kernels.pin(environment, ()) is None
    assert environment == {"OPENBLAS_CORETYPE": "NEOVERSEN1"}


def test_what_is_pinned_ignores_the_libraries_own_variables() -> None:
    names = tuple(kernels.LADDER)
    environment = {"OPENBLAS_CORETYPE": "Nehalem", "NPY_DISABLE_CPU_FEATURES": "X86_V4"}
    assert kernels.pin(environment, names) == "Haswell"
    assert environment.pop("OPENBLAS_CORETYPE") == "Haswell"
    assert "X86_V4" in environment.pop("NPY_DISABLE_CPU_FEATURES").split()
    assert not environment


def test_a_processor_without_the_usual_ones_has_the_first_that_it_can_run(subtests) -> None:
    for lacks, pinned in [(1, "Haswell"), (2, "Sandybridge"), (3, "Nehalem")]:
        with subtests.test(lacks=lacks):
            environment = {"NPY_DISABLE_CPU_FEATURES": "X86_V4"}
            assert kernels.pin(environment, tuple(kernels.LADDER)[lacks:]) == pinned
            assert environment == {"OPENBLAS_CORETYPE": pinned}


def test_the_widest_kernels_can_be_chosen() -> None:
    environment = {kernels.CHOICE: "SkylakeX", "NPY_DISABLE_CPU_FEATURES": "X86_V4"}
    assert kernels.pin(environment, tuple(kernels.LADDER)) == "SkylakeX"
    assert environment == {kernels.CHOICE: "SkylakeX", "OPENBLAS_CORETYPE": "SkylakeX"}


def test_kernels_that_the_processor_lacks_are_refused_with_those_it_has() -> None:
    environment = {kernels.CHOICE: "SkylakeX"}
    with pytest.warns(UserWarning, match="'SkylakeX'; this machine runs Haswell, Sandybridge"):
        assert kernels.pin(environment, tuple(kernels.LADDER)[1:]) == "Haswell"
    assert environment["OPENBLAS_CORETYPE"] == "Haswell"


@cache
def _imports(file: Path) -> list[str]:
    """What a module imports when it is imported, in order."""
    names = []
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module != "__future__":
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


def _pins(file: Path) -> bool:
    """Whether kernels are pinned before anything else is imported."""
    return file.exists() and _imports(file)[:1] == ["buildarena_geometry.kernels"]


def _unpinned(package: Path) -> list[str]:
    wrong = []
    for file in package.rglob("*.py"):
        if not NUMERIC.intersection(name.partition(".")[0] for name in _imports(file)):
            continue
        parents = [
            folder / "__init__.py" for folder in file.parents if package.parent in folder.parents
        ]
        if not any(_pins(place) for place in (file, *parents)):
            wrong.append(str(file.relative_to(ROOT)))
    return wrong


def test_whatever_loads_numpy_pins_the_kernels_first() -> None:
    assert [file for package in PACKAGES for file in _unpinned(package)] == []
