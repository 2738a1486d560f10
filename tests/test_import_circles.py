"""No module of the repository imports itself by way of others."""

import tomllib
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"][
    "root_packages"
]


def circles(graph: grimp.ImportGraph) -> list[list[str]]:
    """Groups of modules that import each other, directly or by way of each other.

    Every import counts: at the head of a file, inside functions, and for type checkers alone.
    """
    down = {name: graph.find_modules_directly_imported_by(name) for name in graph.modules}
    below = {name: _reached(name, down) for name in down}
    grouped = {
        tuple(sorted(other for other in below[name] if name in below[other]))
        for name in down
        if name in below[name]
    }
    return [list(group) for group in sorted(grouped)]


def _reached(start: str, down: dict[str, set[str]]) -> set[str]:
    """The modules that one imports, directly or by way of others."""
    found: set[str] = set()
    waiting = [start]
    while waiting:
        new = down[waiting.pop()] - found
        found |= new
        waiting.extend(new)
    return found


def test_no_module_imports_itself_by_way_of_others():
    graph = grimp.build_graph(*PACKAGES, cache_dir=None)
    assert len(PACKAGES) == 12
    assert circles(graph) == []


@pytest.mark.parametrize(
    ("second", "expected"),
    [
        ("", []),
        ("import circle.first\n", [["circle.first", "circle.second"]]),
        (
            "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from circle import first\n",
            [["circle.first", "circle.second"]],
        ),
        ("def f():\n    import circle.first\n", [["circle.first", "circle.second"]]),
    ],
)
def test_a_circle_is_named_wherever_its_imports_stand(tmp_path, monkeypatch, second, expected):
    package = tmp_path / "circle"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "first.py").write_text("import circle.second\n")
    (package / "second.py").write_text(second)
    monkeypatch.syspath_prepend(str(tmp_path))
    assert circles(grimp.build_graph("circle", cache_dir=None)) == expected
