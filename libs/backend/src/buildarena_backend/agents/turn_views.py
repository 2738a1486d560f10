"""Turns of unfinished and of interrupted sessions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Final

from sqlalchemy import RowMapping

from buildarena_backend.artifacts.store import ArtifactStore
from buildarena_backend.events import Event
from buildarena_backend.jobs.job import Job
from buildarena_backend.journal.external_calls import ExternalCall
from buildarena_backend.journal.transcript import ActionResult, ModelTurn, Transcript, Turn
from buildarena_backend.states import EXTERNAL_PROVIDER, JobState, Outcome
from buildarena_backend.store import Store

UNSCORED: Final = frozenset({Outcome.ERRORED, Outcome.CANCELLED})
"""Jobs that ended without their own transcript, or with one of an earlier suspension."""

_KEPT: Final = (
    *("index", "stage", "sub_structure", "role"),
    *("input_tokens", "output_tokens", "latency_s", "tries"),
)
"""Fields of a turn that are the same in the journal."""


class Transcripts:
    """Reads the transcripts of jobs in any state."""

    def __init__(self, store: Store, artifacts: ArtifactStore) -> None:
        self._store = store
        self._artifacts = artifacts

    def read(self, job: Job) -> bytes | None:
        """Return the job's transcript up to now; None while it has no turn."""
        digest = self._store.jobs.artifacts(job.id).get("transcript")
        ended = job.state == JobState.DONE and job.outcome not in UNSCORED
        if digest is not None and ended:
            return self._artifacts.get(digest)
        turns = self._so_far(job)
        if not turns:
            return None if digest is None else self._artifacts.get(digest)
        return Transcript(turns).to_json()

    def turns_of(self, job_id: str, events: Sequence[Event]) -> dict[int, dict[str, Any]]:
        """Return the turns to which some events of a job refer, by the events' ids.

        Args:
            events: Events of the kind ``turn``, in order.
        """
        if not events:
            return {}
        turns: Sequence[Turn]
        if "sequence" in events[0].data:
            after, until = events[0].id - 1, events[-1].id
            records = self._store.turns.read(job_id, after=after, until=until)
            turns = [turn_of_record(record) for record in records]
        else:
            first, last = (int(event.data["index"]) for event in (events[0], events[-1]))
            with self._store.database.transaction() as connection:
                calls = self._store.external_calls.read(
                    job_id, connection=connection, first=first, count=last - first + 1
                )
            turns = [turn_of_call(index, call) for index, call in enumerate(calls, start=first)]
        by_index = {turn.index: asdict(turn) for turn in turns}
        by_event = {event.id: by_index.get(int(event.data["index"])) for event in events}
        return {id_: turn for id_, turn in by_event.items() if turn is not None}

    def _so_far(self, job: Job) -> list[Turn]:
        if job.model_config.get("provider") != EXTERNAL_PROVIDER:
            return [turn_of_record(record) for record in self._store.turns.read(job.id)]
        with self._store.database.transaction() as connection:
            calls = self._store.external_calls.read(job.id, connection=connection)
        return [turn_of_call(index, call) for index, call in enumerate(calls)]


def turn_of_record(record: RowMapping) -> ModelTurn:
    """Return a model's turn from its reply in the journal and the results."""
    reply = record["reply"]
    done = zip(reply["calls"], record["results"], strict=True)
    return ModelTurn(
        **{name: record[name] for name in _KEPT},
        text=reply["text"],
        finish=reply["finish"],
        cost_usd=f"{record['cost_usd']:.6f}",
        actions=tuple(
            ActionResult(name=name, arguments=arguments, ok=ok, reason=reason, feedback=feedback)
            for (_, name, arguments), (ok, reason, feedback) in done
        ),
    )


def turn_of_call(index: int, call: ExternalCall) -> Turn:
    """Return an external agent's turn; its reasoning is unknown."""
    return Turn(
        index=index,
        stage="external",
        sub_structure=call.machine,
        role="agent",
        text="",
        actions=(
            ActionResult(
                name=call.tool,
                arguments=call.arguments,
                ok=call.ok,
                reason=call.reason,
                feedback=call.feedback,
            ),
        ),
    )
