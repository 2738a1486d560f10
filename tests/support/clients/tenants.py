"""Tenants of a service that asks for keys: each a key with its own requests."""

from dataclasses import dataclass
from typing import Any

from httpx import Client, Response
from pydantic import SecretStr
from sqlalchemy import text

from buildarena_backend.database.database import Database
from buildarena_backend.database.tables import metadata

ADMIN = "operator-secret-that-is-long-enough"
WITH_KEYS = {"require_keys": True, "admin_key": SecretStr(ADMIN), "rate_limit": "1000000/minute"}
"""Settings of a service that asks for keys, as often as tests like to ask."""


@dataclass(frozen=True)
class Tenant:
    """A key's holder."""

    client: Client
    secret: str
    id: str | None

    def ask(self, method: str, path: str, **more: Any) -> Response:
        """The answer to a request with the key."""
        headers = {"Authorization": f"Bearer {self.secret}", **more.pop("headers", {})}
        return self.client.request(method, path, headers=headers, **more)

    def get(self, path: str) -> Any:
        """The JSON of an answer that is good."""
        answer = self.ask("GET", path)
        assert answer.is_success, answer.text
        return answer.json()

    def post(self, path: str, body: Any = None, *, status: int | None = None) -> Any:
        """The JSON of an answer that is good, or has this status."""
        answer = self.ask("POST", path, json=body)
        assert answer.is_success if status is None else answer.status_code == status, answer.text
        return answer.json()


def operator(client: Client) -> Tenant:
    """The one with the admin key of the settings."""
    return Tenant(client, ADMIN, None)


def new_tenant(client: Client, name: str, *scopes: str) -> Tenant:
    """Somebody with a new key."""
    body = {"name": name, "scopes": list(scopes) or ["submit"]}
    made = operator(client).post("/v1/keys", body)
    return Tenant(client, made["secret"], made["id"])


def everything(database: Database) -> dict[str, list[str]]:
    """All rows of all tables, but for the register of workers, and for when keys were used and
    workers notified."""
    rows = "SELECT (to_jsonb(t) - 'used_at')::text FROM {} t"
    with database.transaction() as connection:
        return {
            table.name: sorted(connection.execute(text(rows.format(table.name))).scalars())
            for table in metadata.sorted_tables
            if table.name != "workers"
        }
