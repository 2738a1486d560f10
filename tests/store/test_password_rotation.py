"""Another login of the database's owner: how its password is changed while processes run."""

import re
from collections.abc import Iterator

import pytest
from sqlalchemy import text
from sqlalchemy.exc import OperationalError

from buildarena_store import Database

STEPS = """
CREATE ROLE {new} LOGIN PASSWORD 'another-secret' IN ROLE {owner};
ALTER ROLE {new} SET role = '{owner}';
"""


def execute(database: Database, *statements: str) -> None:
    with database.statement() as connection:
        for statement in statements:
            connection.execute(text(statement))


@pytest.fixture
def roles(database_url: str, worker_id: str) -> Iterator[tuple[Database, str, str]]:
    """The server as its operator sees it, the owner of a database of its own, and a new login."""
    owner, new, name = (f"{each}_{worker_id}" for each in ("owner", "second", "rotated"))
    operator = Database(database_url)
    execute(
        operator,
        f"CREATE ROLE {owner} LOGIN PASSWORD 'secret'",
        f"CREATE DATABASE {name} OWNER {owner}",
    )
    yield operator, owner, new
    execute(
        operator,
        f"DROP DATABASE {name} WITH (FORCE)",
        f"DROP ROLE IF EXISTS {new}",
        f"DROP ROLE {owner}",
    )
    operator.close()


def login(database_url: str, role: str, password: str, database: str) -> Database:
    url = re.sub(r"//[^@]*@", f"//{role}:{password}@", database_url)
    return Database(re.sub(r"/test_\w+", f"/{database}", url))


def test_a_second_login_takes_over_while_the_first_is_still_used(
    database_url, worker_id, roles
) -> None:
    operator, owner, new = roles
    first = login(database_url, owner, "secret", f"rotated_{worker_id}")
    first.migrate()
    execute(operator, *STEPS.format(owner=owner, new=new).strip().splitlines())
    second = login(database_url, new, "another-secret", f"rotated_{worker_id}")
    second.require_schema()
    for database in (first, second):
        execute(database, "UPDATE sweeps SET name = name")
    # What the new login makes belongs to the owner, so that migrations go on working.
    execute(second, "CREATE TABLE made_later (x int)")
    with second.statement() as connection:
        made = text("SELECT tableowner FROM pg_tables WHERE tablename = 'made_later'")
        assert connection.execute(made).scalar_one() == owner
    execute(operator, f"ALTER ROLE {owner} NOLOGIN")
    first.close()
    with pytest.raises(OperationalError, match="not permitted to log in"):
        execute(first, "SELECT 1")
    execute(second, "DROP TABLE made_later")
    first.close()
    second.close()
