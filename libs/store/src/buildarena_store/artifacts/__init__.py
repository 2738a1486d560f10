"""Artifacts: the store of large results, which of them anything refers to, and what goes."""

from buildarena_store.artifacts.collecting import Collected, GarbageCollector
from buildarena_store.artifacts.storing import ArtifactInfo, ArtifactStore, StoredArtifact

__all__ = ["ArtifactInfo", "ArtifactStore", "Collected", "GarbageCollector", "StoredArtifact"]
