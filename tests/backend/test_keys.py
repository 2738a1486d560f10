"""API keys and their secrets, names and whose they are."""

from datetime import timedelta

import pytest
from sqlalchemy import text
from support.jobs import execute

from buildarena_backend.accounts.names import claim_name
from buildarena_backend.errors import RefusedError, UnknownIdError


@pytest.fixture
def keys(context):
    return context.store.keys


def refusals(keys, *secrets: str) -> list[str | None]:
    return [keys.check(secret).refusal for secret in secrets]


def test_a_key_is_found_by_its_secret_alone_which_is_not_stored(context, keys) -> None:
    key, secret = keys.create(name="ada", scopes=["read", "submit"])
    assert keys.get(key.id).used_at is None
    found = keys.check(secret)
    assert (found.key.id, found.refusal) == (key.id, None)
    assert found.key.scopes == ["read", "submit"]
    assert keys.all()[0].used_at is not None
    assert keys.check(secret + "x") is None
    assert keys.check(key.id) is None
    with context.store.database.statement() as connection:
        (row,) = connection.execute(text("SELECT api_keys::text FROM api_keys")).scalars()
    assert secret.removeprefix("ba_") not in row


def test_revoked_and_expired_keys_are_reported_apart_and_get_no_new_secret(keys) -> None:
    revoked, revoked_secret = keys.create(name="a", scopes=["read"])
    first = keys.revoke(revoked.id).revoked_at
    assert keys.revoke(revoked.id).revoked_at == first
    expired, expired_secret = keys.create(name="b", scopes=["read"], ttl=timedelta(seconds=-1))
    for key, why in ((revoked, "is revoked"), (expired, "is expired: make a new one")):
        with pytest.raises(RefusedError, match=f"{key.id} {why}"):
            keys.rotate(key.id, overlap=timedelta(0))
    assert refusals(keys, revoked_secret, expired_secret) == ["revoked", "expired"]
    for ask in (keys.get, keys.revoke, lambda key: keys.rotate(key, overlap=timedelta(0))):
        with pytest.raises(UnknownIdError, match="unknown key 'key_x'"):
            ask("key_x")


def test_a_rotated_key_keeps_its_id_and_for_a_while_its_last_secret(keys) -> None:
    key, first = keys.create(name="ada", scopes=["submit"])
    again, second = keys.rotate(key.id, overlap=timedelta(hours=1))
    assert (again.id, again.scopes) == (key.id, key.scopes)
    assert again.previous_until is not None
    assert refusals(keys, first, second) == [None, None]
    _, third = keys.rotate(key.id, overlap=timedelta(days=1))
    assert keys.check(first) is None
    assert refusals(keys, second, third) == [None, None]
    _, fourth = keys.rotate(key.id, overlap=timedelta(0))
    assert refusals(keys, third, fourth) == ["replaced", None]
    _, fifth = keys.rotate(key.id, overlap=timedelta(days=1))
    keys.revoke(key.id)
    assert refusals(keys, fourth, fifth) == ["revoked", "revoked"]


@pytest.fixture
def claim(context):
    def take(name: str, owner: str | None = "key_1", kind: str = "agent", **more) -> None:
        with context.store.database.transaction() as connection:
            claim_name(kind, name, owner=owner, connection=connection, **more)

    return take


@pytest.mark.parametrize("kind", ["agent", "task"])
def test_what_looks_like_anothers_name_is_not_to_be_had(claim, kind) -> None:
    claim("ada-1", kind=kind)
    for like in ("Ada-1", "ada1", "a.d.a.1", "ADA_1", "adal", "AdaI", "ada-l"):
        with pytest.raises(RefusedError, match=f"{like}.*looks like 'ada-1'"):
            claim(like, "key_2", kind)
        with pytest.raises(RefusedError):
            claim(like, None, kind)
        claim(like, kind=kind)
    for first, second in (
        ("modern", "modem"),
        ("wave", "vvave"),
        ("O-neil", "0neil"),
        ("b5", "bs"),
    ):
        claim(first, kind=kind)
        with pytest.raises(RefusedError, match="looks like"):
            claim(second, "key_2", kind)
    for number, name in enumerate(["ada", "adam", "ada-2", "ada-3", "bda"]):
        claim(name, f"key_{number}", kind)


def test_players_share_names_tasks_do_not_and_reserved_ones_are_nobodys(claim) -> None:
    claim("ada")
    with pytest.raises(RefusedError, match="'Ada' looks like 'ada', which is the name of an"):
        claim("Ada", kind="human")
    claim("ada", "key_2", "task")
    claim("ada", None, force=True)
    with pytest.raises(RefusedError):
        claim("ada", None)
    claim("support-11", kind="task", reserved=["support-1"])
    with pytest.raises(RefusedError, match="looks like 'support-1'"):
        claim("supp0rt-1", kind="task", reserved=["support-1"])


def test_who_had_a_name_before_it_looked_like_anothers_keeps_it(claim, context) -> None:
    rows = "('agent', 'ada', 'a'), ('agent', 'Ada', 'b')"
    execute(context, f"INSERT INTO names (kind, name, owner) VALUES {rows}")
    claim("ada", "a")
    claim("Ada", "b")
    with pytest.raises(RefusedError):
        claim("Ada", "a")
