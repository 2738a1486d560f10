"""Keeps turns as they are taken, so that a session can be watched while it is under way."""

from __future__ import annotations

from buildarena_pipeline.transcript import ModelTurn
from buildarena_store import JournalEntry, Lease, TurnResult, Turns


class TurnKeeper:
    """Keeps each turn of a job once, however often its session is run again.

    Args:
        turns: Where turns are kept.
        lease: The lease that the session runs under.
    """

    def __init__(self, turns: Turns, lease: Lease) -> None:
        self._turns = turns
        self._lease = lease
        self._kept = 0 if lease.first else turns.count(lease.job.id)

    def __call__(self, turn: ModelTurn, entry: JournalEntry) -> None:
        """Keeps a turn, unless an earlier run of the session did."""
        if turn.index < self._kept:
            return
        results = [(action.ok, action.reason, action.feedback) for action in turn.actions]
        self._turns.append(
            self._lease,
            TurnResult(
                index=turn.index,
                sequence=entry.sequence,
                sub_structure=turn.sub_structure,
                results=results,
            ),
        )
