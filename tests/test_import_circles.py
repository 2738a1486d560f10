"""No module, and no folder, of the repository imports itself by way of others."""

import tomllib
from collections.abc import Iterable
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"][
    "root_packages"
]


def circles(graph: grimp.ImportGraph) -> list[list[str]]:
    """Groups of modules, or of neighbours in a folder, that import each other.

    Every import counts: at the head of a file, inside functions, and for type checkers alone.
    """
    folders = [name for name in graph.modules if graph.find_children(name)]
    imports = [{name: graph.find_modules_directly_imported_by(name) for name in graph.modules}]
    imports += [_between(graph, graph.find_children(folder)) for folder in folders]
    return [circle for each in imports for circle in _circles_of(each)]


def _between(graph: grimp.ImportGraph, neighbours: Iterable[str]) -> dict[str, set[str]]:
    """What each of some neighbours imports of the others, each with all that it contains."""
    inside = {name: {name} | graph.find_descendants(name) for name in neighbours}
    home = {module: name for name, modules in inside.items() for module in modules}
    return {
        name: {
            home[imported]
            for module in modules
            for imported in graph.find_modules_directly_imported_by(module)
            if home.get(imported, name) != name
        }
        for name, modules in inside.items()
    }


def _circles_of(imports: dict[str, set[str]]) -> list[list[str]]:
    below = {name: _reached(name, imports) for name in imports}
    groups = {
        tuple(sorted(other for other in below[name] if name in below[other]))
        for name in imports
        if name in below[name]
    }
    return [list(group) for group in sorted(groups)]


def _reached(start: str, imports: dict[str, set[str]]) -> set[str]:
    """What one imports, directly or by way of others."""
    reached: set[str] = set()
    waiting = [start]
    while waiting:
        new = imports[waiting.pop()] - reached
        reached |= new
        waiting.extend(new)
    return reached


def test_nothing_imports_itself_by_way_of_others():
    graph = grimp.build_graph(*PACKAGES, cache_dir=None)
    assert len(PACKAGES) >= 12
    assert circles(graph) == []


CIRCLE = ["circle.first", "circle.second"]


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        ({"first.py": "import circle.second\n", "second.py": ""}, []),
        ({"first.py": "import circle.second\n", "second.py": "import circle.first\n"}, CIRCLE),
        (
            {
                "first.py": "import circle.second\n",
                "second.py": "from typing import TYPE_CHECKING\n"
                "if TYPE_CHECKING:\n    from circle import first\n",
            },
            CIRCLE,
        ),
        (
            {
                "first.py": "import circle.second\n",
                "second.py": "def f():\n    import circle.first\n",
            },
            CIRCLE,
        ),
        (
            {
                "first/__init__.py": "",
                "first/top.py": "import circle.second.top\n",
                "first/bottom.py": "",
                "second/__init__.py": "",
                "second/top.py": "import circle.first.bottom\n",
            },
            CIRCLE,
        ),
    ],
)
def test_a_circle_is_named_wherever_its_imports_are(tmp_path, monkeypatch, files, expected):
    for name, text in {"__init__.py": "", **files}.items():
        file = tmp_path / "circle" / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    graph = grimp.build_graph("circle", cache_dir=None)
    # Two modules that import each other are neighbours as well.
    assert {tuple(circle) for circle in circles(graph)} == (
        {tuple(expected)} if expected else set()
    )
