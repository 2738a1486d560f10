"""Copying artifacts from one store to another."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

from buildarena_store import ArtifactDamagedError, ArtifactMissingError, ArtifactStore

AT_ONCE: Final = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Copied:
    """What a copy found.

    Attributes:
        sizes: Lengths of the artifacts that the target now has, by their hashes.
        missing: What is wrong with those that the source could not give, by their hashes.
        new: How many the target had not.
    """

    sizes: dict[str, int]
    missing: dict[str, str]
    new: int


def copy_artifacts(source: ArtifactStore, target: ArtifactStore, hashes: Sequence[str]) -> Copied:
    """Copies what the target lacks; every byte that is copied is checked.

    Raises:
        ArtifactStoreError: A store can't be read or written now.
    """
    there = {item.hash: item.size for item in target.all()}

    def size_of(digest: str) -> int | str:
        if digest in there:
            return there[digest]
        try:
            data = source.get(digest)
        except (ArtifactMissingError, ArtifactDamagedError) as error:
            return str(error)
        return target.put(data, "").size

    with ThreadPoolExecutor(AT_ONCE) as pool:
        outcomes = dict(zip(hashes, pool.map(size_of, hashes), strict=True))
    sizes = {digest: size for digest, size in outcomes.items() if isinstance(size, int)}
    return Copied(
        sizes=sizes,
        missing={
            digest: problem for digest, problem in outcomes.items() if isinstance(problem, str)
        },
        new=sum(digest not in there for digest in sizes),
    )
