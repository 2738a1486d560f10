import pytest

from buildarena_store import ArtifactDamagedError, ArtifactMissingError, ArtifactStore


def test_bytes_come_back_by_their_hash(tmp_path) -> None:
    store = ArtifactStore(tmp_path / "a")
    info = store.put(b"machine", "application/json")
    assert store.put(b"machine", "application/json") == info
    assert store.get(info.hash) == b"machine"
    assert info.size == 7


def test_damage_is_noticed(tmp_path) -> None:
    store = ArtifactStore(tmp_path / "a")
    info = store.put(b"machine", "application/json")
    (tmp_path / "a" / info.hash[:2] / info.hash).write_bytes(b"machinf")
    with pytest.raises(ArtifactDamagedError, match="damaged"):
        store.get(info.hash)


def test_what_is_not_there_is_an_error(tmp_path, subtests) -> None:
    for name in ["0" * 64, "../../etc/passwd", "", "A" * 64, "a" * 63]:
        with subtests.test(name=name), pytest.raises(ArtifactMissingError):
            ArtifactStore(tmp_path / "a").get(name)
