from datetime import timedelta

import pytest
from sqlalchemy import text

from buildarena_pipeline.runtime.context import Context
from buildarena_store import EndedKeyError, UnknownIdError


def test_a_key_is_found_by_its_secret_alone(context) -> None:
    key, secret = context.store.keys.create(name="ada", scopes=["read", "submit"])
    found = context.store.keys.check(secret)
    assert found is not None
    assert (found.key.id, found.refusal) == (key.id, None)
    assert found.key.scopes == ["read", "submit"]
    assert context.store.keys.check(secret + "x") is None
    assert context.store.keys.check(key.id) is None


def test_a_secret_is_nowhere_in_the_database(context) -> None:
    _, secret = context.store.keys.create(name="ada", scopes=["read"])
    with context.store.database.statement() as connection:
        rows = connection.execute(text("SELECT api_keys::text FROM api_keys")).scalars().all()
    assert len(rows) == 1
    assert secret.removeprefix("ba_") not in rows[0]


def test_revoked_and_expired_keys_are_reported_apart(context) -> None:
    revoked, revoked_secret = context.store.keys.create(name="a", scopes=["read"])
    context.store.keys.revoke(revoked.id)
    first = context.store.keys.revoke(revoked.id).revoked_at
    assert first == context.store.keys.get(revoked.id).revoked_at
    _, expired_secret = context.store.keys.create(
        name="b", scopes=["read"], ttl=timedelta(seconds=-1)
    )
    checks = [context.store.keys.check(secret) for secret in (revoked_secret, expired_secret)]
    assert [check.refusal for check in checks if check is not None] == ["revoked", "expired"]


def test_the_last_use_is_noted(context) -> None:
    key, secret = context.store.keys.create(name="a", scopes=["read"])
    assert context.store.keys.get(key.id).used_at is None
    context.store.keys.check(secret)
    assert context.store.keys.all()[0].used_at is not None


def test_an_unknown_key_is_named(context) -> None:
    for ask in (context.store.keys.get, context.store.keys.revoke):
        with pytest.raises(UnknownIdError, match="no key 'key_x'"):
            ask("key_x")


def refusal_of(context: Context, secret: str) -> str | None:
    found = context.store.keys.check(secret)
    assert found is not None
    return found.refusal


def test_a_rotated_key_keeps_its_id_and_for_a_while_its_secret(context) -> None:
    key, first = context.store.keys.create(name="ada", scopes=["submit"])
    again, second = context.store.keys.rotate(key.id, overlap=timedelta(hours=1))
    assert (again.id, again.scopes) == (key.id, key.scopes)
    assert again.previous_until is not None
    for secret in (first, second):
        found = context.store.keys.check(secret)
        assert found is not None
        assert (found.key.id, found.refusal) == (key.id, None)


def test_a_secret_is_refused_when_its_overlap_is_over(context) -> None:
    key, first = context.store.keys.create(name="ada", scopes=["submit"])
    _, second = context.store.keys.rotate(key.id, overlap=timedelta(0))
    assert refusal_of(context, first) == "replaced"
    assert refusal_of(context, second) is None


def test_rotating_twice_leaves_the_last_two_secrets(context) -> None:
    key, first = context.store.keys.create(name="ada", scopes=["submit"])
    _, second = context.store.keys.rotate(key.id, overlap=timedelta(days=1))
    _, third = context.store.keys.rotate(key.id, overlap=timedelta(days=1))
    assert context.store.keys.check(first) is None
    assert (refusal_of(context, second), refusal_of(context, third)) == (None, None)


def test_revoking_a_rotated_key_ends_both_secrets(context) -> None:
    key, first = context.store.keys.create(name="ada", scopes=["submit"])
    _, second = context.store.keys.rotate(key.id, overlap=timedelta(days=1))
    context.store.keys.revoke(key.id)
    assert (refusal_of(context, first), refusal_of(context, second)) == ("revoked", "revoked")
    with pytest.raises(EndedKeyError, match=f"{key.id} is revoked"):
        context.store.keys.rotate(key.id, overlap=timedelta(0))


def test_no_secret_of_a_key_that_ended_or_is_unknown_is_made(context) -> None:
    key, secret = context.store.keys.create(name="b", scopes=["read"], ttl=timedelta(seconds=-1))
    with pytest.raises(EndedKeyError, match="is expired: make a new one"):
        context.store.keys.rotate(key.id, overlap=timedelta(0))
    with pytest.raises(UnknownIdError):
        context.store.keys.rotate("key_none", overlap=timedelta(0))
    assert refusal_of(context, secret) == "expired"
