"""Ids on the command line: checked before they become part of a path; a prefix is enough."""

from __future__ import annotations

import re
from typing import Final

from buildarena_cli.errors import CommandError, did_you_mean
from buildarena_client.client import Client
from buildarena_client.paths import at

DIGITS: Final = 20
"""Hex digits of a whole id."""
EXAMPLE: Final = "0a1b2c3d4e5f60718293"
KINDS: Final = ("job", "sweep", "key")
MAX_CANDIDATES: Final = 10


def resolve_id(client: Client, kind: str, word: str) -> str:
    """Return the id for a word of the command line.

    Args:
        client: API client, used if the word is not a complete id.
        kind: Kind of the object, see KINDS.
        word: An id, or the beginning of one, with or without ``kind_``.

    Raises:
        CommandError: The word is not an id of this kind, or is not the beginning of exactly one.
    """
    prefix = checked_prefix(kind, word)
    if len(prefix) == len(kind) + 1 + DIGITS:
        return prefix
    ids = candidates(client, kind, prefix)
    if not ids:
        raise CommandError(f"no {kind}'s id begins with {prefix!r}")
    if len(ids) > 1:
        more = " …" if len(ids) > MAX_CANDIDATES else ""
        shown = ", ".join(ids[:MAX_CANDIDATES])
        raise CommandError(f"several {kind}s' ids begin with {prefix!r}: {shown}{more}")
    return ids[0]


def path_of(client: Client, kind: str, word: str, *parts: str) -> str:
    """Return the path of an object, or of something below it; see `resolve_id`."""
    return at(f"{kind}s", resolve_id(client, kind, word), *parts)


def checked_id(kind: str, value: object) -> str:
    """Return a complete id.

    Raises:
        CommandError: The value is not an id of this kind.
    """
    if not isinstance(value, str) or not re.fullmatch(rf"{kind}_[0-9a-f]{{{DIGITS}}}", value):
        raise CommandError(f"{value!r} is not the id of a {kind}, such as {kind}_{EXAMPLE}")
    return value


def checked_prefix(kind: str, word: str) -> str:
    """Return the beginning of an id, with its ``kind_``.

    Raises:
        CommandError: No id of this kind begins like that.
    """
    match = re.fullmatch(rf"(?:{kind}_)?([0-9a-f]{{1,{DIGITS}}})", word)
    if match is None:
        wrong = word.partition("_")[0]
        hint = did_you_mean(wrong, KINDS) if "_" in word and wrong not in KINDS else ""
        raise CommandError(
            f"{word!r} is not the id of a {kind} (such as {kind}_{EXAMPLE}, or its beginning){hint}"
        )
    return f"{kind}_{match[1]}"


def candidates(client: Client, kind: str, prefix: str) -> list[str]:
    """Return up to MAX_CANDIDATES + 1 ids that begin with a prefix."""
    limit = MAX_CANDIDATES + 1
    if kind == "key":  # which are few
        entries = client.every("/v1/keys")
    else:
        entries = client.get(f"/v1/{kind}s", id_prefix=prefix, limit=limit)["data"]
    return [entry["id"] for entry in entries if entry["id"].startswith(prefix)][:limit]
