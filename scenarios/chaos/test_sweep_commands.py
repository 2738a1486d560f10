"""Commands over shared sweeps from many threads at once: only legal histories, no server error."""

import itertools
import os
import random
import sys
import threading
import time
from collections import Counter, defaultdict
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import httpx
import pytest
from sqlalchemy import text
from support.clients.tenants import WITH_KEYS
from support.servers.live_api import live_api

from buildarena_backend.accounts.budgets import RequestCost
from buildarena_backend.catalog.specs import Budget, SweepSpec
from buildarena_backend.errors import RefusedError, TransientError
from buildarena_backend.journal.journal import JournalEntry, Usage
from buildarena_backend.process.active_lease import ActiveLease, LeaseKeeper
from buildarena_backend.process.job_runner import JobRunner
from buildarena_backend.results.results import JobScore
from buildarena_backend.states import (
    CONSTRUCT_QUEUE,
    JOB_TRANSITIONS,
    SWEEP_TRANSITIONS,
    AttemptResult,
    JobState,
    Outcome,
    SweepState,
)

SECONDS = float(os.environ.get("CHAOS_COMMANDS_S", "6"))
THREADS = 20
SEEDS, WIDE = 1500, 40
JOB = {"task": "support-1", "model": "builtin/idle"}
WORKERS = 3
ACCEPTED = {
    **dict.fromkeys(("pause", "resume", "cancel", "retry", "cancel job"), 200),
    **dict.fromkeys(("submit", "submit job"), 201),
}
"""Commands, and what each is answered with where it is carried out."""
COMMANDS = tuple(ACCEPTED)
SLOWEST_S = 90.0
"""However slow the machine is, each command is carried out once by then."""
KEYS = 3
OTHERS = 0.1
"""Share of the commands over sweeps that are, most likely, another key's."""
WRONG = {
    "jobs that a cancelled sweep pays for": (
        "SELECT jobs.id FROM jobs JOIN sweeps ON sweeps.id = payer "
        "WHERE jobs.state <> 'done' AND sweeps.state = 'cancelled'"
    ),
    "jobs of another key than their payer's": (
        "SELECT jobs.id FROM jobs JOIN sweeps ON sweeps.id = payer "
        "WHERE jobs.owner IS DISTINCT FROM sweeps.owner"
    ),
    "jobs on hold that somebody wants now": (
        "SELECT jobs.id FROM jobs JOIN sweep_jobs ON job_id = jobs.id AND claimed "
        "JOIN sweeps ON sweeps.id = sweep_id WHERE jobs.state = 'on_hold' "
        "AND sweeps.state = 'active'"
    ),
    "cancelled jobs that somebody wants": (
        "SELECT jobs.id FROM jobs JOIN sweep_jobs ON job_id = jobs.id AND claimed "
        "JOIN sweeps ON sweeps.id = sweep_id WHERE outcome = 'cancelled' "
        "AND sweeps.state <> 'cancelled'"
    ),
    "budgets that are not what was journalled at their expense": (
        "SELECT id FROM budgets WHERE spent_requests <> "
        "(SELECT count(*) FROM journal WHERE payer = budgets.id)"
    ),
}
SCORE = JobScore(outcome=Outcome.UNSUCCESSFUL, success=0.0, indicator=0.0)
NEED = RequestCost(cost_usd=0, tokens=10)


def handler(context, rng: random.Random):
    """Asks for a request's budget, then ends the job, hands it back, or fails."""
    store = context.store

    def work(active: ActiveLease) -> None:
        lease = active.lease
        shortage = store.budgets.reserve(lease, NEED)
        if shortage is not None:
            with store.lifecycle.command() as connection:
                store.leases.advance(
                    lease,
                    to=JobState.QUEUED,
                    connection=connection,
                    result=AttemptResult.BUDGET_EXHAUSTED,
                )
                if not shortage.temporary:
                    store.lifecycle.exhaust(
                        shortage.budget_id, shortage.detail, connection=connection
                    )
            return
        entry = JournalEntry(
            sequence=len(store.journal.read(lease.job.id)),
            stage="build",
            role="builder",
            request_hash="h",
            reply={},
            usage=Usage(requests=1, input_tokens=5, output_tokens=5),
            latency_s=0.0,
        )
        store.journal.append(lease, entry)
        chance = rng.random()
        if chance < 0.3:
            raise TransientError("outage", reason="provider_outage")
        if chance < 0.5:
            store.leases.give_up(lease, "no key", reason="missing_key")
        elif chance < 0.7:
            store.leases.hand_back(lease)
        else:
            with store.database.transaction() as connection:
                store.results.finish(lease, SCORE, connection=connection)

    return work


def spec(rng: random.Random) -> dict[str, object]:
    """One of a few sweeps that share jobs; some with a budget that is soon used up."""
    first = rng.randrange(SEEDS)
    payload = {
        "tasks": ["support-1"],
        "models": ["builtin/idle"],
        "seeds": list(range(first, first + WIDE)),
    }
    return payload | (
        {"budget": {"max_requests": rng.randrange(1, 50)}} if rng.random() < 0.6 else {}
    )


class Contest:
    """Lasts its time, and on a slow machine until each command was carried out once."""

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._missing = set(ACCEPTED.items())

    def note(self, command: str, status: int) -> None:
        self._missing.discard((command, status))

    def lasts(self) -> bool:
        elapsed = time.monotonic() - self._began
        return elapsed < SECONDS or (bool(self._missing) and elapsed < SECONDS + SLOWEST_S)


class Commander(threading.Thread):
    """Gives random commands as long as the contest lasts, and counts the answers."""

    def __init__(
        self, url: str, secret: str, seed: int, sweeps: list[str], contest: Contest
    ) -> None:
        super().__init__(name=f"commander-{seed}")
        self._headers = {"Authorization": f"Bearer {secret}"}
        self.answers: Counter[tuple[str, int]] = Counter()
        self.failures: list[str] = []
        self._rng, self._sweeps, self._url = random.Random(seed), sweeps, url
        self._contest = contest

    def run(self) -> None:
        job, mine = "", []
        with httpx.Client(base_url=self._url, timeout=60, headers=self._headers) as client:
            while self._contest.lasts():
                command = self._rng.choice(COMMANDS)
                if command == "submit job" or (command == "cancel job" and not job):
                    command = "submit job"
                    answer = client.post(
                        "/v1/jobs", json=JOB | {"seed": self._rng.randrange(SEEDS)}
                    )
                    job = answer.json()["id"]
                elif command == "cancel job":
                    answer = client.post(f"/v1/jobs/{job}/cancel")
                elif command == "submit" or not self._sweeps:
                    command = "submit"
                    resume = self._rng.random() < 0.5
                    answer = client.post(
                        "/v1/sweeps", params={"resume": resume}, json=spec(self._rng)
                    )
                    if answer.is_success:
                        self._sweeps.append(answer.json()["id"])
                        mine.append(answer.json()["id"])
                else:
                    others = not mine or self._rng.random() < OTHERS
                    chosen = self._rng.choice((self._sweeps if others else mine)[-8:])
                    answer = client.post(f"/v1/sweeps/{chosen}/{command}", json={})
                self.answers[command, answer.status_code] += 1
                self._contest.note(command, answer.status_code)
                if answer.status_code >= 500:
                    self.failures.append(f"{command}: {answer.status_code} {answer.text}")


def work_during(context, contest: Contest, seed: int) -> None:
    keeper = LeaseKeeper(context.store.leases, lambda: None)
    work = handler(context, random.Random(seed))
    runner = JobRunner(context.store.leases, work, keeper, f"w{seed}")
    while contest.lasts():
        runner.process_next(CONSTRUCT_QUEUE)
        time.sleep(0.03)


@pytest.mark.ci
@pytest.mark.timeout(SECONDS * 3 + SLOWEST_S + 120)
def test_commands_at_once_leave_legal_histories(context) -> None:
    contest = Contest()
    sweeps: list[str] = []
    keys = [context.store.keys.create(name=f"K{n}", scopes=["submit"])[1] for n in range(KEYS)]
    with live_api(replace(context, settings=context.settings.model_copy(update=WITH_KEYS))) as url:
        commanders = [
            Commander(url, keys[seed % KEYS], seed, sweeps, contest) for seed in range(THREADS)
        ]
        workers = [
            threading.Thread(target=work_during, args=(context, contest, seed))
            for seed in range(WORKERS)
        ]
        for thread in (*commanders, *workers):
            thread.start()
        for thread in (*commanders, *workers):
            thread.join()
    answers = sum((commander.answers for commander in commanders), Counter())
    sys.stdout.write(f"{sum(answers.values())} commands: {dict(sorted(answers.items()))}\n")
    assert not [failure for commander in commanders for failure in commander.failures]
    assert {status for _, status in answers} <= {200, 201, 403, 409}
    assert all(answers[carried_out] for carried_out in ACCEPTED.items())
    require_legal_histories(context)
    require_states_follow_from_histories(context, sweeps)
    with context.store.database.transaction() as connection:
        for name, query in WRONG.items():
            assert not list(connection.execute(text(query)).scalars()), name


def histories(context) -> tuple[dict[str, list[str]], dict[str, list[str]]]:
    """Kinds of the events of each sweep and of each job, in their order."""
    sweeps, jobs, last = defaultdict(list), defaultdict(list), 0
    while events := context.store.events.after(last, limit=10_000):
        last = events[-1].id
        for event in events:
            if event.sweep_id is not None:
                sweeps[event.sweep_id].append(event.kind)
            else:
                jobs[event.job_id].append(event.kind)
    return sweeps, jobs


def require_legal_histories(context) -> None:
    sweeps, jobs = histories(context)
    for sweep_id, (first, *kinds) in sweeps.items():
        assert first == "submitted", sweep_id
        states = [SweepState.ACTIVE, *map(SweepState, kinds)]
        for before, after in itertools.pairwise(states):
            assert after in SWEEP_TRANSITIONS[before], (sweep_id, states)
    for job_id, kinds in jobs.items():
        states = list(map(JobState, kinds))
        assert states[0] == JobState.QUEUED, job_id
        for before, after in itertools.pairwise(states):
            assert after in JOB_TRANSITIONS[before], (job_id, states)


def require_states_follow_from_histories(context, sweeps: list[str]) -> None:
    by_sweep, by_job = histories(context)
    for sweep_id in set(sweeps):
        kinds = by_sweep[sweep_id]
        last = SweepState.ACTIVE if kinds[-1] == "submitted" else SweepState(kinds[-1])
        assert context.store.sweeps.get(sweep_id).state == last
    for job in context.store.jobs.page(limit=10_000):
        assert job.state == by_job[job.id][-1], job.id


def test_a_pause_never_overwrites_a_used_up_budget(context, submissions) -> None:
    lifecycle, refused = context.store.lifecycle, list[str]()
    for number in range(25):
        done = submissions.submit_sweep(
            SweepSpec(
                tasks=["support-1"],
                models=["builtin/idle"],
                seeds=[number],
                budget=Budget(max_requests=1),
            )
        )
        sweep_id = done.sweep.id
        gate = threading.Barrier(2)

        def exhaust(sweep_id: str = sweep_id, gate: threading.Barrier = gate) -> None:
            gate.wait()
            with lifecycle.command() as connection:
                lifecycle.exhaust(sweep_id, "used up", connection=connection)

        thread = threading.Thread(target=exhaust)
        thread.start()
        gate.wait()
        try:
            lifecycle.pause(sweep_id)
        except RefusedError as error:
            refused.append(str(error))
        thread.join()
        kinds = [event.kind for event in context.store.events.after(0, sweep_id=sweep_id)]
        states = [kind for kind in kinds if kind in set(SweepState)]
        assert states in ([SweepState.BUDGET_EXHAUSTED], [SweepState.PAUSED])
        assert context.store.sweeps.get(sweep_id).state == states[-1]
    assert all(f"is {SweepState.BUDGET_EXHAUSTED};" in text for text in refused)


def test_one_sweep_file_run_from_many_terminals_makes_one_sweep(submissions) -> None:
    payload = SweepSpec(tasks=["support-1"], models=["builtin/idle"], seeds=[0, 1])
    with ThreadPoolExecutor(THREADS) as terminals:
        done = list(
            terminals.map(lambda _: submissions.submit_sweep(payload, resume=True), range(50))
        )
    assert len({one.sweep.id for one in done}) == 1
    assert sum(not one.resumed for one in done) == 1
