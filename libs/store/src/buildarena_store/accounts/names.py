"""Names: each belongs to the key that first used it, decided by a unique row."""

from __future__ import annotations

from typing import Final, Literal

from sqlalchemy import Connection, func, select
from sqlalchemy.dialects.postgresql import insert

from buildarena_store.account_tables import names
from buildarena_store.errors import NameTakenError

NameKind = Literal["agent", "human", "task"]
PLAYERS: Final[frozenset[NameKind]] = frozenset({"agent", "human"})
"""Kinds that stand on leaderboards beside each other: a name is of one of them only."""
PLAYERS_LOCK: Final = 0x706C79  # "ply"


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
        NameTakenError: Another key has it, or it is another kind's; the transaction must be undone.
    """
    if kind in PLAYERS:
        # Rows of two kinds do not collide: without the lock, both could be first.
        lock = func.pg_advisory_xact_lock(PLAYERS_LOCK, func.hashtext(name))
        connection.execute(select(lock))
        others = names.c.kind.in_(sorted(PLAYERS - {kind}))
        taken = select(names.c.kind).where(others, names.c.name == name)
        other = connection.execute(taken).scalar()
        if other is not None:
            raise NameTakenError(kind, name, holder=other)
    row = insert(names).values(kind=kind, name=name, owner=owner)
    connection.execute(row.on_conflict_do_nothing())
    holder = connection.execute(
        select(names.c.owner).where(names.c.kind == kind, names.c.name == name)
    ).scalar()
    if holder != owner and not force:
        raise NameTakenError(kind, name)
