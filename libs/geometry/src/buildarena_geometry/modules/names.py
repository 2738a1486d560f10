"""Names that are found whatever the case and the spaces they are written with."""

from collections import Counter
from collections.abc import Iterable


class CaselessNames:
    """Finds the name that is meant: the same one, or the only one that differs in case alone."""

    __slots__ = ("_exact", "_loose")

    def __init__(self, names: Iterable[str]) -> None:
        """Index the canonical names."""
        self._exact = frozenset(names)
        counts = Counter(map(_folded, self._exact))
        # Custom modules may differ only in case: then only the exact name is unambiguous.
        self._loose = {_folded(name): name for name in self._exact if counts[_folded(name)] == 1}

    def find(self, written: str) -> str | None:
        """Return the canonical name, or None."""
        return written if written in self._exact else self._loose.get(_folded(written))


def _folded(name: str) -> str:
    return " ".join(name.split()).casefold()
