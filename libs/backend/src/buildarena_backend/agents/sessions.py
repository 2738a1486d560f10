"""Sessions of external agents: opened, played through tool calls, submitted, and then simulated."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from threading import Lock
from typing import Any, Literal

from cachetools import LRUCache

from buildarena_backend.accounts.names import claim_name
from buildarena_backend.agents.briefing import (
    LIMITS,
    MAX_CALLS,
    MAX_SESSION_BYTES,
    SessionLimits,
    briefing,
    briefing_digest,
)
from buildarena_backend.agents.submission import resolve_task, single_job, submit_machine
from buildarena_backend.agents.test_trials import TestTrial, request_test, trials_of
from buildarena_backend.agents.turn_views import turn_of_call
from buildarena_backend.agents.workbench import TEST, Workbench, check_arguments, rebuild
from buildarena_backend.catalog.tracks import (
    EXTERNAL_WORKFLOW,
    Track,
    has_data_sheets,
    worlds_of,
)
from buildarena_backend.errors import RefusedError, SubmissionError, UnknownIdError
from buildarena_backend.jobs.job import Job
from buildarena_backend.journal.external_calls import ExternalCall
from buildarena_backend.journal.transcript import Transcript
from buildarena_backend.leases.leases import Lease
from buildarena_backend.process.context import Context
from buildarena_backend.states import EXTERNAL_PROVIDER, EXTERNAL_QUEUE, JobState
from buildarena_backend.trials.known_simulators import (
    sampling_issues,
    simulation_version,
    worlds_here,
    worlds_issues,
)
from buildarena_backend.trials.scoring import find_task, task_of
from buildarena_benchmark import ValidationIssue
from buildarena_benchmark.environment import MAIN
from buildarena_benchmark.environment.tools import building_tools
from buildarena_geometry import Machine, ToolDefinition

AGENT_NAME = re.compile(r"[A-Za-z0-9_.-]{1,80}")
CACHED_BENCHES = 256
PlayerKind = Literal["agent", "human"]
"""Kinds of players: programs and people. Leaderboards show `agent/NAME` and `human/NAME`."""


def _closed(message: str) -> RefusedError:
    """Return the error of a session that is not open, or takes no such call."""
    return RefusedError("session_closed", message)


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionState:
    """Present state of a session.

    Attributes:
        size: Bytes of all arguments and feedback.
        open: Whether it takes calls.
        tests: Its test trials, those under way included.
        max_test_trials: Test trials that it may have.
        tools: The tools that apply to its task.
        briefing: Instructions for its agent, the statement included.
    """

    job: Job
    machines: Mapping[str, Machine]
    calls: int
    size: int
    open: bool
    tests: Sequence[TestTrial]
    max_test_trials: int
    limits: SessionLimits = LIMITS
    tools: Sequence[ToolDefinition]
    statement: str
    briefing: str


class ExternalSessions:
    """Lets external agents build through tool calls."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._benches: LRUCache[tuple[str, int], Workbench] = LRUCache(CACHED_BENCHES)
        self._lock = Lock()

    def open(
        self,
        *,
        task: str,
        agent: str,
        seed: int,
        simulator: str,
        kind: PlayerKind = "agent",
        owner: str | None = None,
        force: bool = False,
        data_sheets: bool = True,
        worlds: int | None = None,
    ) -> tuple[SessionState, bool]:
        """Open a session for one task, which belongs to the key that opened it.

        A session that is open already is given again to its owner: the first answer may be lost.

        Args:
            agent: The agent's name, which is the key's from now on.
            kind: Kind of player; no name has both kinds.
            owner: Id of the API key; None for the operator.
            force: Play under another key's name, as an admin may.
            data_sheets: Whether it is given the numbers of modules and world.
            worlds: Varied worlds in which its machine is scored; None for the service's default.

        Returns:
            The session, and whether it is new.

        Raises:
            SubmissionError: Something is unknown, or the agent's session of this seed is over or
                another key's.
            RefusedError: The name is another key's, or of the other kind.
        """
        issues = worlds_issues(self._context, simulator, worlds)
        if not AGENT_NAME.fullmatch(agent):
            message = "1 to 80 letters, digits, dots, dashes and underscores"
            issues.append(ValidationIssue(path="agent", message=message))
        chosen = resolve_task(self._context, task, simulator, more_issues=issues)
        undrawn = sampling_issues(self._context, simulator, worlds, {"task": chosen})
        if undrawn:
            raise SubmissionError(undrawn)
        on_demand = chosen.constraints.on_demand
        track = Track(
            workflow=EXTERNAL_WORKFLOW,
            simulator=simulator,
            simulation_version=simulation_version(self._context, simulator),
            prompts="own",
            prompts_digest=briefing_digest(on_demand=on_demand, data_sheets=data_sheets),
            on_demand=on_demand,
            data_sheets=data_sheets,
            worlds=worlds_here(self._context, simulator, worlds),
        )
        config = {"name": f"{kind}/{agent}", "provider": EXTERNAL_PROVIDER, "model": agent}
        new = single_job(chosen, config, track, seed=seed, owner=owner)
        (job_id,) = new.job_ids
        # Refused inside the transaction, so that nothing of it stays.
        with self._context.store.database.transaction() as connection:
            claim_name(kind, agent, owner=owner, connection=connection, force=force)
            self._context.store.jobs.add([new], connection=connection)
            calls = self._context.store.external_calls
            reopened = not calls.open(job_id, connection=connection)
            if reopened:
                lease = calls.lease(job_id, connection=connection)
                if lease is None or lease.job.owner != owner:
                    message = (
                        f"{kind} {agent!r} has played seed {seed} of {task}: take another seed"
                    )
                    raise SubmissionError([ValidationIssue(path="seed", message=message)])
        return self.view(job_id), not reopened

    def call(self, job_id: str, *, machine: str, tool: str, arguments: Any) -> ExternalCall:
        """Carry out one tool call and keep it.

        Raises:
            RefusedError: The session is not open, or its calls are too many or too large.
            SubmissionError: The arguments are too large or too deep.
        """
        check_arguments(arguments)
        with self._context.store.database.transaction() as connection:
            lease = self._open_lease(job_id, connection)
            count = lease.job.actions
            if tool.lower() == TEST:
                raise _closed(f"{TEST} is not a tool: test trials are requested separately")
            if count >= MAX_CALLS:
                raise _closed(
                    f"session {job_id} has made {MAX_CALLS} calls, the most it may make: submit it"
                )
            bench = self._bench(lease.job, count, connection)
            if bench.size >= MAX_SESSION_BYTES:
                self._store_workbench(job_id, count, bench)
                raise _closed(
                    f"session {job_id} has {bench.size:,} bytes of arguments and feedback, of "
                    f"{MAX_SESSION_BYTES:,} that it may have: submit it"
                )
            done = bench.call(machine, tool, arguments)
            self._context.store.external_calls.append(lease, count, done, connection=connection)
        self._store_workbench(job_id, count + 1, bench)
        return done

    def view(self, job_id: str) -> SessionState:
        """Return the state of a session's workbench, during or after the session.

        Raises:
            UnknownIdError: The session does not exist.
        """
        job = self.job(job_id)
        with self._context.store.database.transaction() as connection:
            calls = self._context.store.external_calls.read(job_id, connection=connection)
        with self._lock:
            bench = self._benches.pop((job_id, len(calls)), None)
        if bench is None:
            bench = self._rebuilt(calls, job)
        tasks = self._context.tasks
        task, plain = find_task(job, tasks), tasks.exact(job.task, job.task_version)
        # A call in between works on its own workbench, so this one stays as it is.
        machines = {name: machine.copy() for name, machine in bench.machines.items()}
        state = SessionState(
            job=job,
            machines=machines,
            calls=len(calls),
            size=bench.size,
            open=job.state == JobState.RUNNING and job.queue == EXTERNAL_QUEUE,
            tests=trials_of(self._context, job_id, task) if task and task.test_trials else (),
            max_test_trials=task.test_trials if task else 0,
            tools=building_tools(task),
            statement=plain.statement if plain else "",
            briefing=briefing(
                plain,
                data_sheets=has_data_sheets(job.track_config),
                worlds=worlds_of(job.track_config),
            )
            if plain
            else "",
        )
        self._store_workbench(job_id, len(calls), bench)
        return state

    def test(self, job_id: str) -> Job:
        """Have the present machine tried; the session continues afterwards.

        Raises:
            RefusedError: The session is not open.
            NothingToSubmitError: It has no machine, or several without an assembly.
            RefusedError: No test trial is left, or the machine breaks a rule.
        """
        context = self._context
        with context.store.database.transaction() as connection:
            lease = self._open_lease(job_id, connection)
            count = lease.job.actions
            calls = context.store.external_calls.read(job_id, connection=connection)
            bench = self._rebuilt(calls, lease.job)
            name, machine = bench.result() or (MAIN, bench.submitted())
            task = task_of(lease.job, context.tasks)
            done = bench.call(name, TEST, {})
            context.store.external_calls.append(lease, count, done, connection=connection)
            _, queue = request_test(context, lease, task, machine, connection=connection)
        context.queues.wake(queue)
        return context.store.jobs.get(job_id)

    def submit(self, job_id: str) -> Job:
        """End the session: the machine is checked and goes to the simulator.

        Raises:
            RefusedError: The session is not open.
            NothingToSubmitError: It has no machine, or several without an assembly.
        """
        context = self._context
        with context.store.database.transaction() as connection:
            lease = self._open_lease(job_id, connection)
            calls = context.store.external_calls.read(job_id, connection=connection)
            bench = self._rebuilt(calls, lease.job)
            machine = bench.submitted()
            transcript = Transcript([turn_of_call(i, call) for i, call in enumerate(calls)])
            queue = submit_machine(context, lease, machine, transcript, connection=connection)
        if queue is not None:
            context.queues.wake(queue)
        return context.store.jobs.get(job_id)

    def job(self, session_id: str) -> Job:
        """Return the job of a session.

        Raises:
            UnknownIdError: The job does not exist, or no agent builds for it.
        """
        try:
            job = self._context.store.jobs.get(session_id)
        except UnknownIdError as error:
            raise UnknownIdError("session", session_id) from error
        if job.track_config.get("workflow") != EXTERNAL_WORKFLOW:
            raise UnknownIdError("session", session_id)
        return job

    def _open_lease(self, job_id: str, connection: Any) -> Lease:
        lease = self._context.store.external_calls.lease(job_id, connection=connection)
        if lease is None or lease.job.track_config.get("workflow") != EXTERNAL_WORKFLOW:
            job = self.job(job_id)
            state = job.outcome or f"{job.stage} {job.state}"
            if job.outcome is None and job.queue.startswith("simulate."):
                state += ": its machine is being tried"
            raise _closed(f"session {job_id} is not open: it is {state}")
        return lease

    def _bench(self, job: Job, count: int, connection: Any) -> Workbench:
        """Return the workbench after a number of calls: cached from the last call, or rebuilt."""
        with self._lock:
            bench = self._benches.pop((job.id, count), None)
        if bench is not None:
            return bench
        calls = self._context.store.external_calls.read(job.id, connection=connection)
        return self._rebuilt(calls, job)

    def _rebuilt(self, calls: Sequence[ExternalCall], job: Job) -> Workbench:
        data_sheets = has_data_sheets(job.track_config)
        return rebuild(calls, find_task(job, self._context.tasks), data_sheets=data_sheets)

    def _store_workbench(self, job_id: str, count: int, bench: Workbench) -> None:
        with self._lock:
            self._benches[job_id, count] = bench
