"""Names: each belongs to the key that first used it, decided by a unique row."""

from __future__ import annotations

from typing import Literal

from sqlalchemy import Connection, select
from sqlalchemy.dialects.postgresql import insert

from buildarena_store.errors import NameTakenError
from buildarena_store.tables import names

NameKind = Literal["agent", "task"]


def claim_name(
    kind: NameKind,
    name: str,
    *,
    owner: str | None,
    connection: Connection,
    force: bool = False,
) -> None:
    """Makes a name the key's own, unless another key has it.

    Of two keys that use a new name at once, one gets it: the other waits for the first one's
    transaction, and then finds the name taken or free.

    Args:
        kind: What is named.
        name: The name.
        owner: The key; None for the operator.
        connection: The transaction that also uses the name.
        force: Use another key's name, as an admin may; it stays the other key's.

    Raises:
        NameTakenError: Another key has it; the transaction must be undone.
    """
    row = insert(names).values(kind=kind, name=name, owner=owner)
    connection.execute(row.on_conflict_do_nothing())
    holder = connection.execute(
        select(names.c.owner).where(names.c.kind == kind, names.c.name == name)
    ).scalar()
    if holder != owner and not force:
        raise NameTakenError(kind, name)
