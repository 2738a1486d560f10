"""Many values as one: arrays and tables that travel to Postgres as a single parameter."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import ARRAY, BindParameter, Column, Text, bindparam, column, func, literal
from sqlalchemy.dialects.postgresql import JSONB
from sqlalchemy.sql.selectable import TableValuedAlias


def bound_texts(values: Sequence[str]) -> BindParameter[Sequence[str]]:
    """Texts as one array parameter, for ``any_`` and ``unnest``."""
    return bindparam(None, list(values), ARRAY(Text))


def rows_of(rows: Sequence[Mapping[str, Any]], columns: Sequence[Column[Any]]) -> TableValuedAlias:
    """Rows as a table to select from, sent as one JSON text.

    Args:
        rows: JSON values by column name.
        columns: The columns they are meant for, which give names and types.
    """
    table = func.jsonb_to_recordset(literal(json.dumps(rows), Text).cast(JSONB))
    typed = [column(one.name, one.type) for one in columns]
    return table.table_valued(*typed).render_derived(name="given", with_types=True)
