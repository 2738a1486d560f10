"""Copying artifacts from one store to another."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

from buildarena_backend.artifacts.storing import ArtifactStore
from buildarena_backend.errors import ArtifactDamagedError, ArtifactMissingError

AT_ONCE: Final = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Copied:
    """What a copy found.

    Attributes:
        sizes: Lengths of the artifacts that the target now has, by their hashes.
        missing: What is wrong with those that the source could not give, by their hashes.
        new: How many the target had not, or not whole.
    """

    sizes: dict[str, int]
    missing: dict[str, str]
    new: int


def copy_artifacts(
    source: ArtifactStore, target: ArtifactStore, sizes: Mapping[str, int | None]
) -> Copied:
    """Copies what the target lacks or has in another size; every byte that is copied is checked.

    Args:
        source: Where the artifacts are.
        target: Where they go.
        sizes: Their lengths by their hashes; None where nobody noted one.

    Raises:
        ArtifactStoreError: A store can't be read or written now.
    """
    there = {item.hash: item.size for item in target.all()}
    whole = {
        digest
        for digest, size in sizes.items()
        if digest in there and size in {None, there[digest]}
    }

    def size_of(digest: str) -> int | str:
        if digest in whole:
            return there[digest]
        try:
            data = source.get(digest)
        except (ArtifactMissingError, ArtifactDamagedError) as error:
            return str(error)
        return target.put(data, "").size

    with ThreadPoolExecutor(AT_ONCE) as pool:
        outcomes = dict(zip(sizes, pool.map(size_of, sizes), strict=True))
    copied = {digest: size for digest, size in outcomes.items() if isinstance(size, int)}
    return Copied(
        sizes=copied,
        missing={
            digest: problem for digest, problem in outcomes.items() if isinstance(problem, str)
        },
        new=sum(digest not in whole for digest in copied),
    )
