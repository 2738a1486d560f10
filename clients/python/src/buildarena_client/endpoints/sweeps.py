"""Sweeps, from their submission to their end."""

from __future__ import annotations

import uuid
from collections.abc import AsyncGenerator, Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

from buildarena_client.endpoints.base import PAGE, POLL_S, Sender
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
        SweepFault,
    )

STOPPED: Final = ("budget_exhausted", "paused")
"""States of sweeps that start no more jobs."""
MAX_BYTES: Final = 2 * 1024 * 1024
"""Maximum file size: room for the 100,000 seeds that a sweep can name."""


class Sweeps(Sender):
    """Sweeps, from their submission to their end."""

    def sweeps(
        self, /, *, limit: int | None = None, page: int = PAGE, **filters: Any
    ) -> AsyncGenerator[Sweep, None]:
        """Yield sweeps, the newest first, page after page as needed.

        Args:
            limit: Maximum number of rows. Defaults to all.
            page: Rows per request, 1 to 200.
            filters: ``name``, ``state`` and ``key_id``, each one or a list.
        """
        return self._listed("/v1/sweeps", limit, page, filters)

    async def sweep(self, sweep_id: str) -> Sweep:
        """Return a sweep and its progress."""
        return cast("Sweep", await self.get(at("sweeps", sweep_id)))

    async def submit_sweep(
        self,
        spec: Mapping[str, Any] | Path,
        *,
        resume: bool = False,
        request_key: str | None = None,
    ) -> SweepAccepted:
        """Submit every task with every model and every seed; all or nothing is stored.

        Args:
            spec: Fields of a sweep, or a YAML file with them.
            resume: True to continue an earlier sweep of exactly these jobs.
            request_key: Idempotency key: the same one with the same sweep returns the first
                submission's response. Defaults to a new one, so that a submission with a lost
                response is sent again and stored once.
        """
        headers = {"Idempotency-Key": request_key or uuid.uuid4().hex}
        answer = await self.post(
            "/v1/sweeps", _fields(spec), repeatable=True, headers=headers, resume=resume or None
        )
        return cast("SweepAccepted", answer)

    async def estimate_sweep(self, spec: Mapping[str, Any] | Path) -> SweepEstimate:
        """Return a sweep's jobs and their estimated cost, without storing anything.

        Args:
            spec: Fields of a sweep, or a YAML file with them.
        """
        answer = await self.post("/v1/sweeps/estimate", _fields(spec), repeatable=True)
        return cast("SweepEstimate", answer)

    async def pause_sweep(self, sweep_id: str) -> Sweep:
        """Put a sweep's waiting jobs on hold; running jobs continue."""
        return cast("Sweep", await self.post(at("sweeps", sweep_id, "pause")))

    async def resume_sweep(self, sweep_id: str, *, budget: Budget | None = None) -> Sweep:
        """Resume a paused sweep, or one with an exhausted budget, with a larger one if given."""
        body = {} if budget is None else {"budget": budget}
        return cast("Sweep", await self.post(at("sweeps", sweep_id, "resume"), body))

    async def set_sweep_budget(self, sweep_id: str, budget: Budget) -> Sweep:
        """Replace a sweep's budget; a sweep whose budget was exhausted continues."""
        return cast("Sweep", await self.put(at("sweeps", sweep_id, "budget"), budget))

    async def sweep_forecast(self, sweep_id: str) -> Forecast:
        """Return the expected end and cost of a sweep, from its progress so far."""
        return cast("Forecast", await self.get(at("sweeps", sweep_id, "forecast")))

    async def cancel_sweep(self, sweep_id: str) -> Sweep:
        """Cancel a sweep's jobs that have not ended and that no other sweep has claimed."""
        return cast("Sweep", await self.post(at("sweeps", sweep_id, "cancel")))

    async def retry_sweep(self, sweep_id: str) -> Sweep:
        """Queue a sweep's errored jobs again from the stages that failed."""
        return cast("Sweep", await self.post(at("sweeps", sweep_id, "retry")))

    async def sweep_results(self, sweep_id: str) -> list[JobResult]:
        """Return the ended jobs of a sweep, by task, model and seed."""
        results = await self.every(at("sweeps", sweep_id, "results"))
        return sorted(results, key=lambda result: (result["task"], result["model"], result["seed"]))

    async def sweep_faults(self, sweep_id: str) -> list[SweepFault]:
        """Return the attempts at a sweep's jobs that faults ended, the newest kinds first."""
        return await self.every(at("sweeps", sweep_id, "faults"))

    def sweep_events(self, sweep_id: str, *, after: int = 0) -> AsyncGenerator[Event, None]:
        """Yield the events of a sweep and its jobs from the beginning, and wait for more.

        A stream that is cut continues where it was.

        Args:
            after: Id of the last known event, such as a sweep's ``last_event``.
        """
        return self._events(at("sweeps", sweep_id, "events"), after)

    async def watch_sweep(
        self, sweep_id: str, *, poll_s: float = POLL_S
    ) -> AsyncGenerator[Sweep, None]:
        """Yield a sweep repeatedly, until it stops.

        The last one shows its end: every job has ended, or all others are on hold. It waits for a
        service that is restarting.

        Args:
            poll_s: Polling interval, seconds.
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
        """Wait until a sweep stops, and return it.

        Args:
            progress: Callback for the sweep after each request.
            poll_s: Polling interval, seconds.
            timeout_s: Maximum wait, seconds. Defaults to no limit.

        Raises:
            TimedOutError: It has not stopped within the time.
        """
        answer = await self._when(
            at("sweeps", sweep_id), sweep_has_stopped, timeout_s, poll_s=poll_s, progress=progress
        )
        return cast("Sweep", answer)


def sweep_has_stopped(sweep: Sweep) -> bool:
    """Check if a sweep has stopped: every job has ended, or all others are on hold."""
    progress = sweep["progress"]
    moving = [name for name in progress["stages"] if not name.endswith(" on_hold")]
    return not moving and (progress["done"] == progress["total"] or sweep["state"] in STOPPED)


def _fields(spec: Mapping[str, Any] | Path) -> dict[str, Any]:
    """Return the fields of a sweep.

    Args:
        spec: Fields, or a YAML file with them.

    Raises:
        BadArgumentError: The file can't be read, or contains something other than a mapping.
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
