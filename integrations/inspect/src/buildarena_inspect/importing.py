"""Brings samples of logs into a service: their calls are made again, and judged there."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from hashlib import sha256
from itertools import islice
from typing import Any, Final

from buildarena_benchmark.environment import ASSEMBLY, MAIN
from buildarena_benchmark.environment.workbench import NAME
from buildarena_client import Client, RefusedError, TimedOutError
from buildarena_geometry.json_values import levels
from buildarena_inspect.logs import LoggedSample, Unusable

PREFIX: Final = "inspect-"
"""Begins the name of every imported builder, so that a leaderboard says where it comes from."""
MAX_NAME: Final = 80
MAX_CALLS: Final = 1999
"""What a session may have, but for one that an empty machine needs."""
MAX_BYTES: Final = 64 << 10
MAX_DEPTH: Final = 20
"""What the arguments of a session's call may have."""
MAX_SEED: Final = 2**53 - 1
UNKNOWN: Final = 404
CONFLICT: Final = 409
UNPROCESSABLE: Final = 422
SAME: Final = 1e-6
"""Indicators that differ by a smaller share are the same."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Imported:
    """A sample that is a job of the service now.

    Attributes:
        sample: Its id in the data set.
        epoch: Its epoch.
        agent: The builder's name there, without the ``agent/`` before it.
        job: The job's id.
        again: Whether an earlier import had brought it.
        outcome: How the job ended; None where it has not ended yet.
        differences: Where the service's figures are others than the log's, in words.
    """

    sample: str
    epoch: int
    agent: str
    job: str
    again: bool
    outcome: str | None
    differences: tuple[str, ...] = field(default=())


def bring(
    sample: LoggedSample, service: Client, *, agent: str | None = None, within_s: float
) -> Imported | Unusable:
    """Makes a sample's calls again in a session, and compares what the service finds.

    The seed is made of the sample's own id, so a sample gives one job however often it is brought,
    and an import that was broken off goes on where it stopped.

    Args:
        service: Where to.
        agent: The builder's name, which is put behind ``inspect-``; the model's by default.
        within_s: Seconds to wait for the job's end.

    Raises:
        ClientError: The service does not answer, or refuses what it should not.
    """
    why = _hindrance(sample, service)
    if why:
        return Unusable(sample=sample.sample, epoch=sample.epoch, why=why)
    name = (PREFIX + (agent or sample.agent))[:MAX_NAME]
    wanted: dict[str, Any] = {
        "task": sample.conditions.task,
        "agent": name,
        "seed": seed_of(sample),
        "simulator": sample.conditions.simulator,
    }
    try:
        opened = service.open_session(**wanted)
    except RefusedError as error:
        found = None
        if error.status == UNPROCESSABLE:
            with suppress(RefusedError):  # nobody of this name has played
                found = _brought_before(wanted, service)
        if found is None:
            raise
        job_id, again = found, True
    else:
        job_id, again = str(opened["id"]), False
        _play(sample, service, job_id, made=int(opened["calls"]))
    job = _ended(job_id, service, within_s)
    return Imported(
        sample=sample.sample,
        epoch=sample.epoch,
        agent=name,
        job=job_id,
        again=again,
        outcome=job["outcome"],
        differences=tuple(_differences(sample, job)) if job["state"] == "done" else (),
    )


def seed_of(sample: LoggedSample) -> int:
    """The seed of a sample's job."""
    digest = sha256(sample.uuid.encode()).digest()
    return int.from_bytes(digest[:8], "big") % (MAX_SEED + 1)


def _hindrance(sample: LoggedSample, service: Client) -> str:
    """Why the service could not judge a sample as its log did; "" where it can."""
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
        if error.status != UNKNOWN:
            raise
        return str(error)
    if task["version"] != sample.task_version:
        return (
            f"it was built for {conditions.task} at version {sample.task_version}, and "
            f"the service has {task['version']}"
        )
    return ""


def _play(sample: LoggedSample, service: Client, session: str, *, made: int) -> None:
    # What a session does not even read was refused in the log too, and changed nothing.
    sent = [call for call in sample.calls if _readable(call)]
    for call in sent[made:]:
        service.call_tool(session, call["tool"], call["arguments"], machine=call["machine"])
    try:
        service.submit_session(session)
    except RefusedError as error:
        if error.status != CONFLICT:
            raise
        # Nothing to submit is a failure in the log, so it is one here: of an empty machine.
        machines = {call["machine"] for call in sent}
        machine = ASSEMBLY if len(machines) > 1 else MAIN
        service.call_tool(session, "get_machine_summary", machine=machine)
        service.submit_session(session)


def _ended(job_id: str, service: Client, within_s: float) -> Mapping[str, Any]:
    """A job once it has ended, or as it is when the time is over."""
    try:
        return service.wait_for_job(job_id, timeout_s=within_s)
    except TimedOutError:
        return service.job(job_id)


def _readable(call: Mapping[str, Any]) -> bool:
    arguments = call["arguments"]
    deep = next(islice(levels(arguments), MAX_DEPTH, None), None) is not None
    if deep or NAME.fullmatch(call["machine"]) is None:
        return False
    return len(json.dumps(arguments).encode()) <= MAX_BYTES


def _brought_before(wanted: dict[str, Any], service: Client) -> str | None:
    """The job that an earlier import made of a sample, if there is one."""
    model = f"agent/{wanted['agent']}"
    cursor: dict[str, str] = {}
    while True:
        page = service.get("/v1/jobs", task=wanted["task"], model=model, limit="200", **cursor)
        for job in page["data"]:
            if job["seed"] == wanted["seed"] and f"/{wanted['simulator']}-" in job["track"]:
                return str(job["id"])
        if page["next_cursor"] is None:
            return None
        cursor = {"cursor": str(page["next_cursor"])}


def _differences(sample: LoggedSample, job: Mapping[str, Any]) -> Iterator[str]:
    """Where the service's figures are others than the log's."""
    there = {"success": sample.success, "flags": sorted(sample.flags)}
    here = {"success": bool(job["success"]), "flags": sorted(job["flags"] or [])}
    for name, value in there.items():
        if value != here[name]:
            yield f"{name}: {value} in the log, {here[name]} in the service"
    found = float(job["indicator"] or 0.0)
    if not math.isclose(sample.indicator, found, rel_tol=SAME, abs_tol=SAME):
        yield f"indicator: {sample.indicator:g} in the log, {found:g} in the service"
