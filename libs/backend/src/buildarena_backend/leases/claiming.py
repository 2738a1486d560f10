"""The statements that claim a job and that count those that wait, as their SQL files have them."""

from __future__ import annotations

from importlib.resources import files
from typing import Final

from sqlalchemy import Boolean, column, text

from buildarena_backend.jobs.job import JOB_COLUMNS
from buildarena_backend.leases.runner_backoff import MISSED_LATELY

OPERATOR: Final = ""
"""Owner of the jobs that no API key submitted."""


def _statement(name: str, **parts: str) -> str:
    written = files(__package__).joinpath(name).read_text(encoding="utf-8")
    for part, sql in parts.items():
        written = written.replace(f"{{{part}}}", sql)
    # What comments say of parameters is none.
    return "\n".join(line for line in written.splitlines() if not line.startswith("--"))


CLAIM: Final = text(
    _statement(
        "claim.sql",
        columns=", ".join(column.name for column in JOB_COLUMNS),
        missed_lately=MISSED_LATELY,
    )
).columns(*JOB_COLUMNS, column("budgeted", Boolean))
WAITING_QUEUES: Final = text(_statement("waiting.sql"))
