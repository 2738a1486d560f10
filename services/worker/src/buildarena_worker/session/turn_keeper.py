"""Keeps turns as they are taken, so that a session can be watched while it is under way."""

from __future__ import annotations

from buildarena_backend.journal.transcript import ModelTurn
from buildarena_backend.journal.turns import TurnResult, Turns
from buildarena_backend.leases.leases import Lease
from buildarena_worker.session.concurrency_gate import ConcurrencyGate


class TurnKeeper:
    """Keeps each turn of a job once, however often its session is run again.

    Args:
        turns: Where turns are kept.
        lease: The lease that the session runs under.
        gate: Where the session gives up its place while the database writes.
    """

    def __init__(self, turns: Turns, lease: Lease, gate: ConcurrencyGate) -> None:
        self._turns = turns
        self._gate = gate
        self._lease = lease
        self._kept = 0 if lease.first else turns.count(lease.job.id)

    def __call__(self, turn: ModelTurn, sequence: int) -> None:
        """Keeps a turn, unless an earlier run of the session did."""
        if turn.index < self._kept:
            return
        results = [(action.ok, action.reason, action.feedback) for action in turn.actions]
        result = TurnResult(
            index=turn.index,
            sequence=sequence,
            sub_structure=turn.sub_structure,
            results=results,
        )
        with self._gate.released():
            self._turns.append(self._lease, result)
