"""Sweeps, from their submission to their end."""

from __future__ import annotations

import uuid
from collections.abc import AsyncGenerator, Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

from buildarena_client.endpoints.sending import PAGE, POLL_S, Sender
from buildarena_client.errors import BadArgumentError, MissingLibraryError
from buildarena_client.event_streams import Event
from buildarena_client.paths import at

if TYPE_CHECKING:
    from buildarena_client.schemas import (
        Budget,
        Forecast,
        JobResult,
        Sweep,
        SweepAccepted,
        SweepEstimate,
        Trouble,
    )

STOPPED: Final = ("budget_exhausted", "paused")
"""States of sweeps of which nothing more starts."""
MAX_BYTES: Final = 2 * 1024 * 1024
"""Largest file: room for the 100,000 seeds that a sweep can name."""


class Sweeps(Sender):
    """Sweeps, from their submission to their end."""

    def sweeps(
        self, /, *, limit: int | None = None, page: int = PAGE, **filters: Any
    ) -> AsyncGenerator[Sweep, None]:
        """Sweeps, the newest first, page after page as they are needed.

        Args:
            limit: How many at most; all by default.
            page: How many are asked for at once, 1 to 200.
            filters: ``name``, ``state`` and ``key_id``, each one or a list.
        """
        return self._listed("/v1/sweeps", limit, page, filters)

    async def sweep(self, sweep_id: str) -> Sweep:
        """A sweep and its progress."""
        return cast("Sweep", await self.get(at("sweeps", sweep_id)))

    async def submit_sweep(
        self,
        spec: Mapping[str, Any] | Path,
        *,
        resume: bool = False,
        request_key: str | None = None,
    ) -> SweepAccepted:
        """Submits every task with every model and every seed; all of it is stored, or nothing.

        Args:
            spec: Fields of a sweep, or the YAML file that has them.
            resume: Whether an earlier sweep of exactly these jobs continues instead.
            request_key: The same key with the same sweep gives the first submission's answer; a
                key of its own by default, so that a submission whose answer was lost is sent again
                and still stored once.
        """
        headers = {"Idempotency-Key": request_key or uuid.uuid4().hex}
        answer = await self.post(
            "/v1/sweeps", _fields(spec), repeatable=True, headers=headers, resume=resume or None
        )
        return cast("SweepAccepted", answer)

    async def estimate_sweep(self, spec: Mapping[str, Any] | Path) -> SweepEstimate:
        """A sweep's jobs and what they may cost; stores nothing.

        Args:
            spec: Fields of a sweep, or the YAML file that has them.
        """
        answer = await self.post("/v1/sweeps/estimate", _fields(spec), repeatable=True)
        return cast("SweepEstimate", answer)

    async def pause_sweep(self, sweep_id: str) -> Sweep:
        """Puts a sweep's waiting jobs on hold; running jobs continue."""
        return cast("Sweep", await self.post(at("sweeps", sweep_id, "pause")))

    async def resume_sweep(self, sweep_id: str, *, budget: Budget | None = None) -> Sweep:
        """Resumes a paused sweep, or one whose budget is used up, with a larger one if given."""
        body = {} if budget is None else {"budget": budget}
        return cast("Sweep", await self.post(at("sweeps", sweep_id, "resume"), body))

    async def set_sweep_budget(self, sweep_id: str, budget: Budget) -> Sweep:
        """Replaces a sweep's budget; one whose budget was used up goes on."""
        return cast("Sweep", await self.put(at("sweeps", sweep_id, "budget"), budget))

    async def sweep_forecast(self, sweep_id: str) -> Forecast:
        """When a sweep ends and what it comes to cost, from what ran so far."""
        return cast("Forecast", await self.get(at("sweeps", sweep_id, "forecast")))

    async def cancel_sweep(self, sweep_id: str) -> Sweep:
        """Ends a sweep's jobs that have not ended and that nobody else wants."""
        return cast("Sweep", await self.post(at("sweeps", sweep_id, "cancel")))

    async def retry_sweep(self, sweep_id: str) -> Sweep:
        """Queues a sweep's errored jobs again where they failed."""
        return cast("Sweep", await self.post(at("sweeps", sweep_id, "retry")))

    async def sweep_results(self, sweep_id: str) -> list[JobResult]:
        """The ended jobs of a sweep, by task, model and seed."""
        results = await self.every(at("sweeps", sweep_id, "results"))
        return sorted(results, key=lambda one: (one["task"], one["model"], one["seed"]))

    async def sweep_troubles(self, sweep_id: str) -> list[Trouble]:
        """Attempts at a sweep's jobs that faults ended, the newest kinds first."""
        return await self.every(at("sweeps", sweep_id, "troubles"))

    def sweep_events(self, sweep_id: str, *, after: int = 0) -> AsyncGenerator[Event, None]:
        """What happens to a sweep and its jobs, from the beginning; waits for more.

        A stream that is cut continues where it was.

        Args:
            sweep_id: The sweep.
            after: The id of the last event that is known, such as a sweep's ``last_event``.
        """
        return self._events(at("sweeps", sweep_id, "events"), after)

    async def watch_sweep(
        self, sweep_id: str, *, poll_s: float = POLL_S
    ) -> AsyncGenerator[Sweep, None]:
        """A sweep again and again, until nothing more will happen to it.

        The last one is how it ended: every job has, or all others are on hold. A service that is
        being restarted is waited for.

        Args:
            sweep_id: The sweep.
            poll_s: Seconds between two looks.
        """
        while True:
            sweep = cast("Sweep", await self.get_patiently(at("sweeps", sweep_id)))
            yield sweep
            if sweep_has_stopped(sweep):
                return
            await self._transport.pause(poll_s)

    async def wait_for_sweep(
        self,
        sweep_id: str,
        *,
        progress: Callable[[Sweep], object] | None = None,
        poll_s: float = POLL_S,
        timeout_s: float | None = None,
    ) -> Sweep:
        """A sweep when nothing more will happen to it.

        Args:
            sweep_id: The sweep.
            progress: Called with the sweep after each look at it.
            poll_s: Seconds between two looks.
            timeout_s: How long to wait; forever by default.

        Raises:
            TimedOutError: It has not stopped within the time.
        """
        answer = await self._when(
            at("sweeps", sweep_id), sweep_has_stopped, timeout_s, poll_s=poll_s, progress=progress
        )
        return cast("Sweep", answer)


def sweep_has_stopped(sweep: Sweep) -> bool:
    """Whether nothing more will happen: every job has ended, or all others are on hold."""
    progress = sweep["progress"]
    moving = [name for name in progress["stages"] if not name.endswith(" on_hold")]
    return not moving and (progress["done"] == progress["total"] or sweep["state"] in STOPPED)


def _fields(spec: Mapping[str, Any] | Path) -> dict[str, Any]:
    """The fields of a sweep.

    Args:
        spec: The fields, or the YAML file that has them.

    Raises:
        BadArgumentError: The file can't be read, or holds something other than a mapping.
        MissingLibraryError: YAML can't be read without a library.
    """
    if isinstance(spec, Mapping):
        return dict(spec)
    if not isinstance(spec, Path):
        raise BadArgumentError(
            f"{spec!r} is not a sweep: give its fields, or the Path of the file that has them"
        )
    try:
        import yaml
    except ImportError as error:
        raise MissingLibraryError(
            "reading a sweep's file", library="PyYAML", extra="yaml"
        ) from error
    try:
        if spec.stat().st_size > MAX_BYTES:
            raise BadArgumentError(f"{spec} has more than {MAX_BYTES:,} bytes")
        content = yaml.safe_load(spec.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadArgumentError(f"{spec}: {error.strerror}") from error
    except (UnicodeDecodeError, yaml.YAMLError, RecursionError) as error:
        raise BadArgumentError(f"{spec} is not valid YAML: {error}") from error
    if not isinstance(content, dict):
        raise BadArgumentError(f"{spec} must be a mapping of fields, such as tasks: [support-1]")
    return content
