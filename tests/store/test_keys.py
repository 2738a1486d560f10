from __future__ import annotations

from datetime import timedelta

import pytest
from sqlalchemy import text

from buildarena_pipeline.runtime.context import Context
from buildarena_store import UnknownIdError


def test_a_key_is_found_by_its_secret_alone(context: Context) -> None:
    key, secret = context.store.keys.create(name="ada", scopes=["read", "submit"])
    found = context.store.keys.check(secret)
    assert found is not None
    assert (found.key.id, found.refusal) == (key.id, None)
    assert found.key.scopes == ["read", "submit"]
    assert context.store.keys.check(secret + "x") is None
    assert context.store.keys.check(key.id) is None


def test_a_secret_is_nowhere_in_the_database(context: Context) -> None:
    _, secret = context.store.keys.create(name="ada", scopes=["read"])
    with context.store.database.transaction() as connection:
        rows = connection.execute(text("SELECT api_keys::text FROM api_keys")).scalars().all()
    assert len(rows) == 1
    assert secret.removeprefix("ba_") not in rows[0]


def test_revoked_and_expired_keys_are_reported_apart(context: Context) -> None:
    revoked, revoked_secret = context.store.keys.create(name="a", scopes=["read"])
    context.store.keys.revoke(revoked.id)
    first = context.store.keys.revoke(revoked.id).revoked_at
    assert first == context.store.keys.get(revoked.id).revoked_at
    _, expired_secret = context.store.keys.create(
        name="b", scopes=["read"], ttl=timedelta(seconds=-1)
    )
    checks = [context.store.keys.check(secret) for secret in (revoked_secret, expired_secret)]
    assert [check.refusal for check in checks if check is not None] == ["revoked", "expired"]


def test_the_last_use_is_noted(context: Context) -> None:
    key, secret = context.store.keys.create(name="a", scopes=["read"])
    assert context.store.keys.get(key.id).used_at is None
    context.store.keys.check(secret)
    assert context.store.keys.all()[0].used_at is not None


def test_an_unknown_key_is_named(context: Context) -> None:
    for ask in (context.store.keys.get, context.store.keys.revoke):
        with pytest.raises(UnknownIdError, match="no key 'key_x'"):
            ask("key_x")
