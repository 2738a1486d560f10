"""What runners try, and strangers without a key: lies, noise, harm, stalled bodies."""

import json
import statistics
import time
from collections import Counter
from contextlib import ExitStack
from typing import Any

import httpx
from scenarios.attack import raw_client
from scenarios.attack.arena import MEBI, Arena, Tried
from scenarios.attack.raw_client import ENGINE, RUNNER, about, beat, leased
from support.servers.lies import LIES, Lie
from support.servers.runner_rig import Caller
from support.servers.stacks import wait_until

TASK = "support-1"
HEALTH = "/v1/health"
HEALTH_S = 0.5
GROWTH_MIB = 150
"""What 200 strangers may cost the API; they held 1,700 MiB."""


def forged_trials(arena: Arena) -> Tried:
    """Lies in trajectories, each by a key of its own, and the truth by another."""
    lies = dict(list(LIES.items())[: int(arena.sizes["lies"])])
    found = Tried(f"{len(lies)} lies in trajectories, and the truth")
    before = _counted(arena)
    brought: dict[str, str] = {}
    known = 0
    for seed, name in enumerate([*lies, "the truth"]):
        job = _submitted(arena, seed)
        runner = _runner(arena)
        answer = _bring(runner, job, lies.get(name, lambda true: true))
        if answer.status_code == 200:
            brought[job] = name
        else:
            known += 1
            found.require(answer.status_code == 422, f"{name}: {answer.status_code}")
            arena.operator.post(f"/v1/jobs/{job}/cancel")
    jobs = {}
    for job in brought:
        wait_until(lambda: _verified(arena, job), 300, f"{job} is verified")
        jobs[job] = arena.operator.get(f"/v1/jobs/{job}")
    audits = Counter(str(job["verification_status"]) for job in jobs.values())
    for id_, job in jobs.items():
        honest = brought[id_] == "the truth"
        found.require(
            (job["verification_status"] == "verified") == honest,
            f"{brought[id_]}: {job['verification_status']}",
        )
    counted = _counted(arena) - before
    found.require(counted == audits["verified"], f"the board counts {counted} more")
    keys = arena.operator.get("/v1/keys?limit=200")["data"]
    suspended = sum(key["suspended_at"] is not None for key in keys)
    found.require(suspended == audits["refuted"], f"{suspended} keys are suspended")
    found.refused = f"{known} refused at once, of the others {dict(audits)}; {suspended} suspended"
    return found


def noisy_runner(arena: Arena) -> Tried:
    """Heartbeats of megabytes, and more names than a key may have."""
    runner = _runner(arena)
    count = int(arena.sizes["heartbeats"])
    found = Tried(f"{count} heartbeats of 2 MB, as many of 60 kB, {4 * count} names")
    before = _health(arena)
    answers: Counter[int] = Counter()
    large_taken = 0
    large = json.dumps({**beat("noisy"), "versions": {"engine": "x" * 2_000_000}}).encode()
    wordy = {**beat("noisy"), "versions": {"engine": "x" * 60_000}}
    for number in range(count):
        answer = raw_client.asked(runner, content=large)
        answers[answer] += 1
        large_taken += answer == 200
        answers[raw_client.asked(runner, json=wordy)] += 1
        for part in range(4):
            answers[raw_client.asked(runner, json=beat(f"name-{number}-{part}"))] += 1
    after = _health(arena)
    found.require(set(answers) <= {200, 413, 422, 429}, f"answers {answers}")
    found.require(not large_taken, f"{large_taken} of 2 MB were taken")
    found.require(after < HEALTH_S, f"health takes {after:.1f} s")
    workers = arena.operator.get("/v1/workers?limit=200")["data"]
    names = sum(worker["id"].startswith("runner@") for worker in workers)
    found.require(names <= 128 + 10, f"{names} names are in the register")
    found.refused = (
        f"answers {dict(answers)}; {names} names; health {before * 1000:.0f} -> "
        f"{after * 1000:.0f} ms"
    )
    return found


def harmful_runner(arena: Arena) -> Tried:
    """One key says that trials can never be done, fails them, gives them back."""
    jobs = [_submitted(arena, 3000 + number) for number in range(3)]
    runner = _runner(arena)
    found = Tried("every job of a queue said to be impossible, failed and given back by one key")
    ways = {
        "/fault": {"json": {"reason": "simulator_fault", "detail": "no", "permanent": True}},
        "/release": {},
    }
    for job in jobs:
        lease = wait_until(lambda: leased(runner, job), 60, f"{job} waits")
        path, more = list(ways.items())[jobs.index(job) % 2]
        runner.ask("POST", runner.at(lease, path), **more)
    for _ in range(20):
        again = runner.ask("POST", "/leases", json=about("by-hand"))
        if again.status_code == 200:
            runner.ask("POST", runner.at(again.json(), "/release"))
    states = Counter(arena.operator.get(f"/v1/jobs/{job}")["state"] for job in jobs)
    found.require(states["done"] == 0, f"jobs are {dict(states)}")
    honest = _runner(arena)
    for job in jobs:
        answer = _bring(honest, job)
        found.require(answer.status_code == 200, answer.text)
    found.refused = f"jobs {dict(states)}; another key did all"
    return found


def strangers(arena: Arena) -> Tried:
    """Connections with invented keys that promise 4 MiB and stall."""
    count = int(arena.sizes["strangers"])
    found = Tried(f"{count} invented keys, each with a body of 4 MiB that stalls")
    api = arena.process("api")
    before, quick = api.memory_info().rss, _health(arena)
    with ExitStack() as connections:
        opened = [
            connections.enter_context(raw_client.stalled(arena.stack.url)) for _ in range(count)
        ]
        answers = Counter(int(c.recv(4096).split()[1]) for c in opened)
        slow = _health(arena)
        grown = (api.memory_info().rss - before) / MEBI
    found.require(set(answers) <= {401, 429, 503}, f"answers {answers}")
    found.require(grown < GROWTH_MIB, f"the API grew by {grown:.0f} MiB")
    found.require(slow < HEALTH_S, f"health takes {slow:.1f} s")
    found.refused = (
        f"answers {dict(answers)} before any body; API {grown:+.0f} MiB; health "
        f"{quick * 1000:.0f} -> {slow * 1000:.0f} ms"
    )
    return found


def look_alikes(arena: Arena) -> Tried:
    """Names of agents that look like another key's."""
    arena.innocent.post("/v1/sessions", {"task": TASK, "agent": "mortar-2", "seed": 70})
    names = ("Mortar-2", "mortar.2", "rnortar-2", "m0rtar-2", "mortar_2", "MORTAR2")
    answers = Counter(
        arena.attacker.ask(
            "POST", "/v1/sessions", json={"task": TASK, "agent": name, "seed": 70}
        ).status_code
        for name in names
    )
    found = Tried(f"{len(names)} names that look like another key's agent")
    found.require(200 not in answers and 201 not in answers, f"answers {answers}")
    found.refused = f"answers {dict(answers)}"
    return found


def _counted(arena: Arena) -> int:
    """Trials of the expert that the boards of the runners' simulator count."""
    boards = [
        arena.operator.get(f"/v1/leaderboard?track={track}")
        for track in arena.operator.get("/v1/leaderboard")["tracks"]
        if f"/{ENGINE}-" in track
    ]
    rows = [row for board in boards for task in board["tasks"] for row in task["rows"]]
    return sum(row["counted"] for row in rows if row["model"] == "builtin/expert")


def _submitted(arena: Arena, seed: int) -> str:
    job = {"task": TASK, "model": "builtin/expert", "simulator": ENGINE, "worlds": 0}
    return str(arena.innocent.post("/v1/jobs", job | {"seed": 500 + seed})["id"])


def _runner(arena: Arena) -> Caller:
    key = arena.operator.post("/v1/keys", RUNNER)
    return Caller(arena.stack.url, key["secret"], name=f"attack-{key['id']}")


def _bring(runner: Caller, job: str, lie: Lie = lambda true: true) -> httpx.Response:
    """The answer to the outcome of a job's trial, true or not."""
    lease: dict[str, Any] = wait_until(
        lambda: leased(runner, job), 60, f"{job} waits for its trial"
    )
    return raw_client.brought(runner, lease, TASK, lie)


def _verified(arena: Arena, job: str) -> bool:
    """Whether nothing of a job waits for a verification any more."""
    with arena.database.transaction() as connection:
        open_ones = connection.exec_driver_sql(
            "SELECT count(*) FROM verifications WHERE job_id = %s AND state <> 'done'", (job,)
        ).scalar_one()
    return open_ones == 0 and bool(arena.operator.get(f"/v1/jobs/{job}")["verification_status"])


def _health(arena: Arena) -> float:
    """Median seconds of a health check."""
    times = []
    for _ in range(9):
        started = time.monotonic()
        arena.operator.ask("GET", HEALTH)
        times.append(time.monotonic() - started)
    return statistics.median(times)
