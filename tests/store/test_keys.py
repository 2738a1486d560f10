from __future__ import annotations

from datetime import timedelta

import pytest
from sqlalchemy import text

from buildarena_pipeline.runtime.context import Context
from buildarena_store import UnknownIdError


def test_a_key_is_found_by_its_secret_alone(context: Context) -> None:
    key, secret = context.keys.create(name="ada", scopes=["read", "submit"])
    found = context.keys.check(secret)
    assert found is not None
    assert (found.key.id, found.refusal) == (key.id, None)
    assert found.key.scopes == ["read", "submit"]
    assert context.keys.check(secret + "x") is None
    assert context.keys.check(key.id) is None


def test_a_secret_is_nowhere_in_the_database(context: Context) -> None:
    _, secret = context.keys.create(name="ada", scopes=["read"])
    with context.database.transaction() as connection:
        rows = connection.execute(text("SELECT api_keys::text FROM api_keys")).scalars().all()
    assert len(rows) == 1
    assert secret.removeprefix("ba_") not in rows[0]


def test_revoked_and_expired_keys_are_told_apart(context: Context) -> None:
    revoked, revoked_secret = context.keys.create(name="a", scopes=["read"])
    context.keys.revoke(revoked.id)
    first = context.keys.revoke(revoked.id).revoked_at
    assert first == context.keys.get(revoked.id).revoked_at
    _, expired_secret = context.keys.create(name="b", scopes=["read"], lasts=timedelta(seconds=-1))
    checks = [context.keys.check(secret) for secret in (revoked_secret, expired_secret)]
    assert [check.refusal for check in checks if check is not None] == ["revoked", "expired"]


def test_the_last_use_is_noted(context: Context) -> None:
    key, secret = context.keys.create(name="a", scopes=["read"])
    assert context.keys.get(key.id).used_at is None
    context.keys.check(secret)
    assert context.keys.all()[0].used_at is not None


def test_an_unknown_key_is_named(context: Context) -> None:
    for ask in (context.keys.get, context.keys.revoke):
        with pytest.raises(UnknownIdError, match="no key 'key_x'"):
            ask("key_x")
