from __future__ import annotations

from decimal import Decimal

import pytest
from sqlalchemy.exc import IntegrityError

from buildarena_pipeline.runtime.context import Context
from buildarena_store import JournalEntry, Usage

USAGE = Usage(
    requests=1, input_tokens=100, output_tokens=10, cached_tokens=40, cost_usd=Decimal("0.25")
)


def entry(sequence: int) -> JournalEntry:
    return JournalEntry(
        sequence=sequence,
        stage="build",
        role="builder",
        request_hash="h",
        reply={"text": "ü"},
        usage=USAGE,
        latency_s=0.5,
        tries=2,
    )


def test_a_reply_and_its_cost_are_written_together(context: Context, add) -> None:
    (job_id,) = add(1)
    lease = context.store.leases.claim("construct", owner="w")
    assert lease is not None
    context.store.journal.append(lease, entry(0))
    context.store.journal.append(lease, entry(1))
    with pytest.raises(IntegrityError):
        context.store.journal.append(lease, entry(1))
    job = context.store.jobs.get(job_id)
    assert (job.requests, job.input_tokens, job.cost_usd) == (2, 200, Decimal("0.500000"))
    read = context.store.journal.read(job_id)
    assert [e.sequence for e in read] == [0, 1]
    assert read[0].reply == {"text": "ü"}
    assert read[0].usage == USAGE
