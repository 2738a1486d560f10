"""Import of samples into a service, which repeats and scores their calls."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from http import HTTPStatus
from typing import Any, Final

from buildarena_benchmark.environment import ASSEMBLY, MAIN
from buildarena_benchmark.environment.workbench import NAME
from buildarena_client import Client, RefusedError, TimedOutError
from buildarena_geometry.json_texts import write_json
from buildarena_inspect.logs import LoggedSample, Unusable

PREFIX: Final = "inspect-"
"""Prefix of imported builders' names, which shows their origin on leaderboards."""
MAX_NAME: Final = 80
MAX_CALLS: Final = 1999
"""Limit of a session's calls, minus one that an empty machine needs."""
MAX_BYTES: Final = 64 << 10
MAX_DEPTH: Final = 20
"""Limits of the arguments of a session's call."""
MAX_SEED: Final = 2**53 - 1
SAME: Final = 1e-6
"""Relative difference below which indicators are equal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Imported:
    """A sample that was imported as a job.

    Attributes:
        sample: Id in the data set.
        agent: The builder's name in the service, without the prefix ``agent/``.
        job: Id of the job.
        existed: Whether the job existed before the import.
        outcome: Outcome of the job; None if it has not ended.
        differences: Differences of the service's figures from the log's.
    """

    sample: str
    epoch: int
    agent: str
    job: str
    existed: bool
    outcome: str | None
    differences: tuple[str, ...]


def import_sample(
    sample: LoggedSample, service: Client, *, agent: str | None = None, within_s: float
) -> Imported | Unusable:
    """Repeat a sample's calls in a session, and compare the results.

    The seed is derived from the sample's id, so that repeated imports of a sample give one job, and
    interrupted imports can be continued.

    Args:
        agent: The builder's name after ``inspect-``; by default the model's.
        within_s: Maximum wait for the job's end, seconds.

    Raises:
        ClientError: The service does not answer, or refuses the session.
    """
    reason = _obstacle(sample, service)
    if reason:
        return Unusable(sample=sample.sample, epoch=sample.epoch, reason=reason)
    name = (PREFIX + (agent or sample.agent))[:MAX_NAME]
    settings: dict[str, Any] = {
        "task": sample.conditions.task,
        "agent": name,
        "seed": seed_of(sample),
        "simulator": sample.conditions.simulator,
    }
    try:
        opened = service.open_session(**settings)
    except RefusedError as error:
        existing = None
        if error.status == HTTPStatus.UNPROCESSABLE_ENTITY:
            with suppress(RefusedError):  # no agent of this name exists
                existing = _find_import(settings, service)
        if existing is None:
            raise
        job_id, existed = existing, True
    else:
        job_id, existed = str(opened["id"]), False
        _play(sample, service, job_id, made=int(opened["calls"]))
    job = _ended(job_id, service, within_s)
    return Imported(
        sample=sample.sample,
        epoch=sample.epoch,
        agent=name,
        job=job_id,
        existed=existed,
        outcome=job["outcome"],
        differences=tuple(_differences(sample, job)) if job["state"] == "done" else (),
    )


def seed_of(sample: LoggedSample) -> int:
    """Return the seed of a sample's job."""
    digest = sha256(sample.uuid.encode()).digest()
    return int.from_bytes(digest[:8], "big") % (MAX_SEED + 1)


def _obstacle(sample: LoggedSample, service: Client) -> str:
    """Return why the service can't score a sample like its log; "" if it can."""
    conditions = sample.conditions
    if len(sample.calls) > MAX_CALLS:
        return f"it has {len(sample.calls):,} calls, and a session may have {MAX_CALLS:,}"
    if conditions.rounds != 1:
        return f"it was played with {conditions.rounds} rounds, and a session has one trial"
    if sample.trials > 1:
        return f"its machines had {sample.trials} trials, and a session has one"
    try:
        task = service.get(f"/v1/tasks/{conditions.task}")
    except RefusedError as error:
        if error.status != HTTPStatus.NOT_FOUND:
            raise
        return str(error)
    if task["version"] != sample.task_version:
        return (
            f"it was built for {conditions.task} at version {sample.task_version}, and "
            f"the service has {task['version']}"
        )
    return ""


def _play(sample: LoggedSample, service: Client, session: str, *, made: int) -> None:
    # Calls that a session can't read were refused in the log too, and changed nothing.
    sent = [call for call in sample.calls if _readable(call)]
    for call in sent[made:]:
        service.call_tool(session, call["tool"], call["arguments"], machine=call["machine"])
    try:
        service.submit_session(session)
    except RefusedError as error:
        if error.status != HTTPStatus.CONFLICT:
            raise
        # Nothing to submit is a failure in the log, so it is one here: of an empty machine.
        machines = {call["machine"] for call in sent}
        machine = ASSEMBLY if len(machines) > 1 else MAIN
        service.call_tool(session, "get_machine_summary", machine=machine)
        service.submit_session(session)


def _ended(job_id: str, service: Client, within_s: float) -> Mapping[str, Any]:
    """Return a job when it has ended, or its state when the time is over."""
    try:
        return service.wait_for_job(job_id, timeout_s=within_s)
    except TimedOutError:
        return service.job(job_id)


def _readable(call: Mapping[str, Any]) -> bool:
    try:
        size = len(write_json(call["arguments"], MAX_DEPTH))
    except ValueError:
        return False
    return size <= MAX_BYTES and NAME.fullmatch(call["machine"]) is not None


def _find_import(settings: dict[str, Any], service: Client) -> str | None:
    """Return the id of the job of an earlier import, if any."""
    for job in service.jobs(task=settings["task"], model=[f"agent/{settings['agent']}"]):
        if job["seed"] == settings["seed"] and f"/{settings['simulator']}-" in job["track"]:
            return str(job["id"])
    return None


def _differences(sample: LoggedSample, job: Mapping[str, Any]) -> Iterator[str]:
    """Yield the differences of the service's figures from the log's."""
    logged = {"success": sample.success, "flags": sorted(sample.flags)}
    scored = {"success": bool(job["success"]), "flags": sorted(job["flags"] or [])}
    for name, value in logged.items():
        if value != scored[name]:
            yield f"{name}: {value} in the log, {scored[name]} in the service"
    indicator = float(job["indicator"] or 0.0)
    if not math.isclose(sample.indicator, indicator, rel_tol=SAME, abs_tol=SAME):
        yield f"indicator: {sample.indicator:g} in the log, {indicator:g} in the service"
