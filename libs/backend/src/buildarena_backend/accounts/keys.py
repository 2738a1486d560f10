"""API keys and their scopes. Only the hash of a key's secret is stored."""

from __future__ import annotations

import hashlib
import re
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import any_, func, or_, select, update
from sqlalchemy.dialects.postgresql import insert

from buildarena_backend import events
from buildarena_backend.database.account_tables import api_keys
from buildarena_backend.database.database import Database
from buildarena_backend.database.rows import bound_texts, columns_of, known, value_of
from buildarena_backend.errors import RefusedError
from buildarena_backend.ids import new_id

SECRET_PREFIX = "ba_"  # noqa: S105 - what secrets begin with, for scanners that look for leaks
NOTED_EVERY = timedelta(minutes=1)
"""Precision of the time of a key's last use."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ApiKey:
    """A key without its secret.

    Attributes:
        id: Its identifier, which also names its holder's sweeps and budget.
        scopes: ``read``, ``submit``, ``admin``, or only ``runner``.
        simulators: Simulators whose jobs a runner key may lease.
        job_owners: Keys whose jobs a runner key may lease; None for all.
        used_at: Time of its last use, to the minute.
        suspended_at: Runner keys: since then its runners may do nothing, as one of their trials was
            refuted.
        suspended_for: The verification that refuted it.
        previous_until: End of the previous secret's validity; None without one.
    """

    id: str
    name: str
    scopes: Sequence[str]
    simulators: Sequence[str] | None
    job_owners: Sequence[str] | None
    created_at: datetime
    expires_at: datetime | None
    revoked_at: datetime | None
    used_at: datetime | None
    suspended_at: datetime | None
    suspended_for: str | None
    previous_until: datetime | None


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyCheck:
    """Result of checking a presented secret.

    Attributes:
        key: The key with this secret.
        refusal: ``revoked``, ``suspended`` or ``expired``, or ``replaced`` of a secret that a newer
            one has followed; None when the key is valid.
    """

    key: ApiKey
    refusal: str | None


class ApiKeys:
    """Makes, finds and revokes keys."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def create(
        self,
        *,
        name: str,
        scopes: Sequence[str],
        ttl: timedelta | None = None,
        simulators: Sequence[str] | None = None,
        job_owners: Sequence[str] | None = None,
        key_id: str | None = None,
    ) -> tuple[ApiKey, str | None]:
        """Make a key.

        Args:
            ttl: Period of validity; None for no limit.
            simulators: Simulators whose jobs a runner key may lease.
            job_owners: Keys whose jobs a runner key may lease; None for all.
            key_id: Its id, if it is fixed; an existing key is not changed.

        Returns:
            The key, and its secret, which can't be read again; None if the key existed.
        """
        secret, key_id = new_secret(), key_id or new_id("key")
        statement = (
            insert(api_keys)
            .values(
                id=key_id,
                name=name,
                secret_hash=secret_hash(secret),
                scopes=list(scopes),
                simulators=None if simulators is None else list(simulators),
                job_owners=None if job_owners is None else list(job_owners),
                expires_at=None if ttl is None else events.now + ttl,
            )
            .on_conflict_do_nothing(index_elements=["id"])
            .returning(*_COLUMNS)
        )
        row = self._database.first_row(statement)
        return (self.get(key_id), None) if row is None else (value_of(ApiKey, row), secret)

    def check(self, secret: str) -> KeyCheck | None:
        """Return the key that has this secret, and whether it is valid; None if there is none."""
        digest = secret_hash(secret)
        expired = (api_keys.c.expires_at <= events.now).label("expired")
        replaced = (api_keys.c.previous_until <= events.now).label("replaced")
        stale = func.coalesce(api_keys.c.used_at < events.now - NOTED_EVERY, True).label("stale")
        query = select(*_COLUMNS, api_keys.c.secret_hash, expired, replaced, stale).where(
            or_(api_keys.c.secret_hash == digest, api_keys.c.previous_hash == digest)
        )
        with self._database.transaction() as connection:
            row = connection.execute(query).first()
            if row is None:
                return None
            key = value_of(ApiKey, row)
            was_replaced = digest != row.secret_hash and bool(row.replaced)
            refusal = _refusal(key, expired=row.expired, replaced=was_replaced)
            if refusal is None and row.stale:
                noted = update(api_keys).where(api_keys.c.id == key.id)
                connection.execute(noted.values(used_at=events.now))
        return KeyCheck(key=key, refusal=refusal)

    def ended(self, key_ids: Sequence[str]) -> set[str]:
        """Return those of the keys that were revoked or suspended, or have expired."""
        query = select(api_keys.c.id).where(
            api_keys.c.id == any_(bound_texts(key_ids)),
            or_(
                api_keys.c.revoked_at.is_not(None),
                api_keys.c.suspended_at.is_not(None),
                api_keys.c.expires_at <= events.now,
            ),
        )
        return set(self._database.all_values(query))

    def all(self) -> list[ApiKey]:
        """Return every key, oldest first, including revoked and expired ones."""
        query = select(*_COLUMNS).order_by(api_keys.c.created_at, api_keys.c.id)
        return [value_of(ApiKey, row) for row in self._database.all_rows(query)]

    def get(self, key_id: str) -> ApiKey:
        """Return the key with this id.

        Raises:
            UnknownIdError: The key does not exist.
        """
        query = select(*_COLUMNS).where(api_keys.c.id == key_id)
        return value_of(ApiKey, known(self._database.first_row(query), "key", key_id))

    def rotate(self, key_id: str, *, overlap: timedelta) -> tuple[ApiKey, str]:
        """Give a key another secret; it keeps its id, and so all that it owns.

        Args:
            overlap: Time for which the present secret stays valid. The one before it ends at once.

        Returns:
            The key, and its secret, which can't be read again.

        Raises:
            UnknownIdError: The key does not exist.
            RefusedError: It was revoked or has expired.
        """
        secret = new_secret()
        statement = (
            update(api_keys)
            .where(
                api_keys.c.id == key_id,
                api_keys.c.revoked_at.is_(None),
                or_(api_keys.c.expires_at.is_(None), api_keys.c.expires_at > events.now),
            )
            .values(
                previous_hash=api_keys.c.secret_hash,
                previous_until=events.now + overlap,
                secret_hash=secret_hash(secret),
            )
            .returning(*_COLUMNS)
        )
        row = self._database.first_row(statement)
        if row is None:
            key = self.get(key_id)
            state = "revoked" if key.revoked_at else "expired"
            raise RefusedError("illegal_state", f"key {key_id} is {state}: make a new one")
        return value_of(ApiKey, row), secret

    def revoke(self, key_id: str) -> ApiKey:
        """Revoke a key at once; revoking it again changes nothing.

        Raises:
            UnknownIdError: The key does not exist.
        """
        return self._change(key_id, revoked_at=func.coalesce(api_keys.c.revoked_at, events.now))

    def reinstate(self, key_id: str) -> ApiKey:
        """Lift a key's suspension; results of its runners are verified as before.

        Raises:
            UnknownIdError: The key does not exist.
        """
        return self._change(key_id, suspended_at=None, suspended_for=None)

    def _change(self, key_id: str, **values: Any) -> ApiKey:
        statement = (
            update(api_keys).where(api_keys.c.id == key_id).values(**values).returning(*_COLUMNS)
        )
        return value_of(ApiKey, known(self._database.first_row(statement), "key", key_id))


def _refusal(key: ApiKey, *, expired: bool | None, replaced: bool | None) -> str | None:
    if key.revoked_at is not None:
        return "revoked"
    if key.suspended_at is not None:
        return "suspended"
    if expired:
        return "expired"
    return "replaced" if replaced else None


def is_secret(text: str) -> bool:
    """Return whether a text has the form of a secret; no key has any other."""
    return _SECRET.fullmatch(text) is not None


def new_secret() -> str:
    """Return 256 random bits in letters."""
    return SECRET_PREFIX + secrets.token_urlsafe(32)


def secret_hash(secret: str) -> str:
    """Return the hash under which a secret is stored.

    A plain SHA-256 is enough: secrets are 256 random bits, which cannot be guessed from a hash,
    unlike a password.
    """
    return hashlib.sha256(secret.encode()).hexdigest()


_SECRET = re.compile(SECRET_PREFIX + "[A-Za-z0-9_-]{43}")
_COLUMNS = columns_of(ApiKey, api_keys)
