"""Names: each belongs to the key that first used it, with all that look like it."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final, Literal

from sqlalchemy import Connection, func, select, text
from sqlalchemy.dialects.postgresql import insert

from buildarena_backend.database.account_tables import FOLD, names
from buildarena_backend.errors import RefusedError

NameKind = Literal["agent", "human", "task"]
PLAYERS: Final[frozenset[NameKind]] = frozenset({"agent", "human"})
"""Kinds that share leaderboards: a name has only one of them."""
NAMES_LOCK: Final = 0x706C79  # "ply"

_FOLDED: Final = text(f"SELECT {FOLD.format(':name')}")
_LIKE_RESERVED: Final = text(
    f"SELECT reserved FROM unnest(CAST(:names AS text[])) AS reserved "  # noqa: S608 - our own SQL
    f"WHERE {FOLD.format('reserved')} = :folded AND reserved <> :name LIMIT 1"
)


def claim_name(
    kind: NameKind,
    name: str,
    *,
    owner: str | None,
    connection: Connection,
    force: bool = False,
    reserved: Collection[str] = (),
) -> None:
    """Make a name the key's own, unless another key has it or one that looks like it.

    Names that differ only in case, dots, dashes, underscores or letters and digits of the same
    shape look alike. Of two keys that use a new name at once, one gets it: the other waits for the
    first one's transaction, and then finds the name taken or free.

    Args:
        owner: The key; None for the operator.
        connection: The transaction that also uses the name.
        force: Use another key's name, as an admin may; it stays the other key's.
        reserved: Names that no key may claim or resemble.

    Raises:
        RefusedError: Another key has it, or it is another kind's; the transaction must be undone.
    """
    folded = connection.execute(_FOLDED, {"name": name}).scalar_one()
    connection.execute(select(func.pg_advisory_xact_lock(NAMES_LOCK, func.hashtext(folded))))
    parameters = {"names": list(reserved), "folded": folded, "name": name}
    like = connection.execute(_LIKE_RESERVED, parameters).scalar()
    if like is not None:
        raise _name_refusal(kind, name, like)
    kinds = PLAYERS if kind in PLAYERS else {kind}
    query = select(names).where(names.c.folded == folded, names.c.kind.in_(sorted(kinds)))
    for row in connection.execute(query.order_by((names.c.name == name).desc())):
        if row.kind != kind:
            raise _name_refusal(kind, name, row.name, holder=row.kind)
        if row.owner != owner and not force:
            raise _name_refusal(kind, name, row.name)
        if row.name == name:
            return
    connection.execute(insert(names).values(kind=kind, name=name, owner=owner))


def _name_refusal(kind: str, name: str, like: str, *, holder: str | None = None) -> RefusedError:
    """Return why a name is not available.

    Args:
        like: The name that is taken: this one, or one that looks like it.
        holder: The kind that has it, if that is another one.
    """
    whose = "belongs to the key that first used it"
    if holder is not None:
        whose = f"is the name of an {holder}" if holder == "agent" else f"is a {holder}'s name"
    if like != name:
        whose = f"looks like {like!r}, which {whose}"
    detail = f"the {kind} name {name!r} {whose}: choose another name"
    return RefusedError("name_taken", detail)
