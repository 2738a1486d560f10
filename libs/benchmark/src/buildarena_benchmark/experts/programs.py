"""The texts of the expert's programs, and the values filled into them."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources


def quoted(ids: Mapping[str, str]) -> dict[str, str]:
    """Return ids of blocks by their places, as texts of Lua."""
    return {name: f'"{block}"' for name, block in ids.items()}


def listed(ids: Sequence[str]) -> str:
    """Return ids of blocks as a table of Lua."""
    return "{ " + ", ".join(f'"{block}"' for block in ids) + " }"


def program_text(package: str, name: str, **places: str) -> str:
    """Return the text of a program of a category, its places `$name` filled."""
    text = _text(package, name)
    for place, value in places.items():
        text = text.replace(f"${place}", value)
    return text


@cache
def _text(package: str, name: str) -> str:
    text = resources.files(package).joinpath(f"{name}.lua").read_text("utf-8")
    # The first two lines mark the file as benchmark data.
    return text.split("\n", 2)[2]
