"""What an adversary tries: each scenario says what was tried, what came of it, what is wrong."""

import json
import socket
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

from scenarios.attack import load_isolation
from scenarios.attack.arena import HOSTILE, Arena, Tried
from scenarios.attack.multi_process import backups_during_kills, two_processes
from scenarios.attack.outages import flushed_broker, full_disk, killed_supervisor, stopped_broker
from scenarios.attack.runners import (
    forged_trials,
    harmful_runner,
    look_alikes,
    noisy_runner,
    strangers,
)
from support.clients.tenants import everything
from support.servers.api_process import Service
from support.servers.stacks import wait_until

from buildarena_api.routes.tasks import EXAMPLE
from buildarena_cli.local.server import free_port

YAML = {"Content-Type": "application/yaml"}
SWEEP = {"tasks": ["support-1"], "models": ["builtin/idle"], "seeds": [0, 1]}
SESSION = {"task": "support-1", "agent": "mason"}
ROOM_S = 2.0
"""Within so long another key's session starts beside forty that hang."""
MANY = 36
"""Of 40 slots one key gets a few less while another has a session."""
CALM_LOOKS, CALM_EVERY_S = 3, 0.5
"""So many looks must show the same before nothing is under way any more."""
END_S = 3.0
"""Within so long a cancelled session's request ends."""


def _settled(arena: Arena) -> Any:
    """What the database holds once nothing of the service's own is under way."""
    seen, same = everything(arena.database), 0
    while same < CALM_LOOKS:
        time.sleep(CALM_EVERY_S)
        now = everything(arena.database)
        seen, same = now, same + 1 if now == seen else 0
    return seen


def other_tenants(arena: Arena) -> Tried:
    """Another key's sweeps, jobs, sessions, names, keys and budgets."""
    owner, thief = arena.innocent, arena.attacker
    sweep = owner.post("/v1/sweeps", {**SWEEP, "models": [HOSTILE]})["id"]
    owner.post(f"/v1/sweeps/{sweep}/pause")
    session = owner.post("/v1/sessions", SESSION)["id"]
    owner.ask("POST", "/v1/tasks", content=EXAMPLE, headers=YAML)
    job = arena.operator.get(f"/v1/jobs?sweep={sweep}")["data"][0]["id"]
    tries: list[tuple[str, str, dict[str, Any]]] = [
        *(
            ("POST", f"/v1/sweeps/{sweep}/{verb}", {})
            for verb in ("pause", "resume", "cancel", "retry")
        ),
        *(("POST", f"/v1/jobs/{job}/{verb}", {}) for verb in ("cancel", "retry")),
        ("POST", f"/v1/sessions/{session}/calls", {"json": {"tool": "start"}}),
        ("POST", f"/v1/sessions/{session}/submit", {}),
        ("POST", "/v1/sessions", {"json": {**SESSION, "seed": 1}}),
        ("POST", "/v1/sessions", {"json": SESSION}),
        ("POST", "/v1/tasks", {"content": EXAMPLE.replace("200", "250"), "headers": YAML}),
        ("POST", "/v1/keys", {"json": {"name": "x", "scopes": ["admin"]}}),
        ("POST", f"/v1/keys/{owner.id}/revoke", {}),
        ("PUT", f"/v1/keys/{owner.id}/budget", {"json": {"max_requests": 1}}),
    ]
    found = Tried(f"{len(tries)} commands over another key's things")
    before = _settled(arena)
    answers = Counter(thief.ask(m, path, **more).status_code for m, path, more in tries)
    found.refused = f"answers {dict(sorted(answers.items()))}"
    found.require(set(answers) <= {403, 409}, "a command over another key's things was accepted")
    found.require(everything(arena.database) == before, "a refused command changed something")
    # Shared jobs: the thief's commands over a sweep of its own, of the same jobs.
    shared = thief.post("/v1/sweeps", {**SWEEP, "models": [HOSTILE]})["id"]
    owner.post(f"/v1/sweeps/{sweep}/resume")
    for verb in ("pause", "resume", "retry", "cancel"):
        thief.post(f"/v1/sweeps/{shared}/{verb}")
    jobs = arena.operator.get(f"/v1/jobs?sweep={sweep}")["data"]
    found.require(all(job["outcome"] != "cancelled" for job in jobs), "a shared job was cancelled")
    found.require({job["key_id"] for job in jobs} == {owner.id}, "a shared job changed hands")
    owner.post(f"/v1/sweeps/{sweep}/cancel")
    return found


def hanging_provider(arena: Arena) -> Tried:
    """Forty sessions hang; another key's session must start, and cancelling must free all."""
    found = Tried("40 sessions whose provider hangs or drips, then their cancel")
    provider = arena.provider
    before = provider.counts.requests
    provider.fault = lambda number: ("hang", "drip")[number % 2]
    thief = arena.attacker
    payload = {"tasks": ["support-1"], "models": [HOSTILE], "samples": 60}
    sweep = thief.post("/v1/sweeps", payload)["id"]

    def running() -> int:
        return len(arena.operator.get(f"/v1/jobs?sweep={sweep}&state=running&limit=100")["data"])

    wait_until(lambda: running() >= MANY, 60, f"{MANY} sessions run")
    wait_until(lambda: provider.counts.requests - before >= MANY, 60, "requests hang")
    started = time.monotonic()
    body = {"task": "support-1", "model": "builtin/idle", "seed": 77}
    id_ = arena.innocent.post("/v1/jobs", body)["id"]
    wait_until(lambda: arena.innocent.get(f"/v1/jobs/{id_}")["state"] == "done", 30, "a session")
    room = time.monotonic() - started
    found.require(room <= ROOM_S, f"another key's session took {room:.1f} s")
    left = provider.left
    started = time.monotonic()
    thief.post(f"/v1/sweeps/{sweep}/cancel")
    wait_until(lambda: provider.left - left >= MANY, 60, "the provider's requests end")
    took = time.monotonic() - started
    found.require(took <= END_S, f"open requests ended after {took:.1f} s")
    provider.fault = lambda _: None
    found.refused = f"room for another key in {room:.1f} s, requests ended in {took:.1f} s"
    return found


def lying_provider(arena: Arena) -> Tried:
    """Garbage, redirects, ten megabytes, absurd depth, and lies about usage."""
    text = {"choices": [{"message": {"content": "x"}, "finish_reason": "stop"}], "model": "m"}
    lie = {**text, "id": "1", "usage": {"prompt_tokens": -5, "completion_tokens": 10**30}}
    garbage: dict[str, str | bytes] = {
        "not JSON": b"<html>",
        "another shape": b'{"usage": {"prompt_tokens": 7, "completion_tokens": 1}}',
        "10 MB": b'{"choices": "' + b"x" * 10_000_000 + b'"}',
        "nested": b"[" * 200_000,
        "lies about usage": json.dumps(lie).encode(),
    }
    found = Tried(f"{', '.join(garbage)}, redirects")
    seen = []
    for number, (name, fault) in enumerate(garbage.items()):
        arena.provider.fault = lambda _, fault=fault: fault
        body = {
            "task": "support-1",
            "model": HOSTILE,
            "seed": 1000 + number,
            "limits": {"max_requests": 3},
        }
        id_ = arena.attacker.post("/v1/jobs", body)["id"]
        wait_until(lambda: arena.attacker.get(f"/v1/jobs/{id_}")["state"] == "done", 90, name)
        job = arena.attacker.get(f"/v1/jobs/{id_}")
        used = job["usage"]
        seen.append(f"{name}: {job['outcome']}, {used['requests']} requests")
        found.require(used["requests"] <= 3, f"{name}: {used['requests']} requests of 3")
        found.require(used["requests"] >= 1, f"{name}: nothing was counted")
        found.require(used["input_tokens"] >= 0, f"{name}: negative tokens")
        if name == "another shape":
            found.require(used["input_tokens"] == 7 * used["requests"], f"{name}: {used}")
    arena.provider.elsewhere = f"http://127.0.0.1:{free_port()}/"
    arena.provider.fault = lambda _: "307"
    body = {"task": "support-1", "model": HOSTILE, "seed": 2000}
    id_ = arena.attacker.post("/v1/jobs", body)["id"]
    wait_until(lambda: arena.attacker.get(f"/v1/jobs/{id_}")["state"] == "done", 60, "redirect")
    job = arena.attacker.get(f"/v1/jobs/{id_}")
    found.require(job["reason"] == "request_refused", f"redirect: {job['reason']} {job['detail']}")
    arena.provider.fault = lambda _: None
    found.refused = "; ".join([*seen, f"redirect: {job['outcome']}"])
    return found


def flood(kind: str) -> Callable[[Arena], Tried]:
    """A flood of one kind by one key."""

    def scenario(arena: Arena) -> Tried:
        count = int(arena.sizes[kind])
        sweep = _done_sweep(arena, int(arena.sizes["jobs"]))
        service = Service(
            url=arena.stack.url,
            pid=arena.process("api").pid,
            database_url=arena.stack.environment["BUILDARENA_DATABASE_URL"],
            broker_pid=arena.process("valkey").pid,
        )
        both = load_isolation.Tenants(
            service=service,
            attacker=arena.attacker.secret,
            innocent=arena.innocent.secret,
            sweep=sweep,
        )
        measured = load_isolation.flood(both, kind, count, for_s=arena.sizes["flood_s"])
        found = Tried(f"{count} {kind} at once over a sweep of {int(arena.sizes['jobs'])} jobs")
        found.refused = f"answers {measured.answers}"
        found.require(measured.failed == 0, f"{measured.failed} of another key's requests failed")
        found.require(not measured.answers.get("500"), "answers with 500")
        late = kind == "half requests" and measured.longest_s > load_isolation.HEALTH_BOUND_S
        found.require(not late, f"health answered after {measured.longest_s:.1f} s")
        return found

    scenario.__doc__ = f"{kind} at once by one key."
    return scenario


def _done_sweep(arena: Arena, jobs: int) -> str:
    payload = {"tasks": ["support-1"], "models": ["builtin/idle"], "samples": jobs}
    sweep = arena.attacker.post("/v1/sweeps?resume=true", payload)["id"]
    wait_until(lambda: arena.operator.get(f"/v1/sweeps/{sweep}")["state"] == "done", 300, "a sweep")
    return str(sweep)


def truncated_bodies(arena: Arena) -> Tried:
    """Bodies cut off by a disconnect, for everything that changes something."""
    sweep = arena.attacker.post("/v1/sweeps", SWEEP)["id"]
    wait_until(lambda: arena.operator.get(f"/v1/sweeps/{sweep}")["state"] == "done", 60, "a sweep")
    time.sleep(1.5)  # until nothing of the service's own is under way
    before = everything(arena.database)
    paths = {
        "/v1/sweeps": json.dumps(SWEEP | {"seeds": [5]}),
        "/v1/jobs": json.dumps({"task": "support-1", "model": "builtin/idle", "seed": 991}),
        f"/v1/sweeps/{sweep}/cancel": "{}",
        f"/v1/sweeps/{sweep}/resume": "{}",
        "/v1/sessions": json.dumps({**SESSION, "agent": "cut"}),
        "/v1/tasks": EXAMPLE.replace("narrow-gap", "cut-gap"),
    }
    number = 0
    for path, body in paths.items():
        kind = "application/yaml" if path == "/v1/tasks" else "application/json"
        head = (
            f"POST {path} HTTP/1.1\r\nHost: x\r\n"
            f"Authorization: Bearer {arena.attacker.secret}\r\nContent-Type: {kind}\r\n"
        )
        chunk = f"{len(body.encode()):x}\r\n{body}\r\n"
        for sent in (
            f"{head}Content-Length: {len(body.encode()) + 1}\r\n\r\n{body}",
            f"{head}Transfer-Encoding: chunked\r\n\r\n{chunk}",
            f"{head}Transfer-Encoding: chunked\r\n\r\n{chunk}0\r\n",
        ):
            with socket.create_connection(
                (arena.stack.settings.host, arena.stack.settings.port)
            ) as s:
                s.sendall(sent.encode())
            number += 1
    time.sleep(1.0)
    found = Tried(f"{number} bodies cut off by a disconnect")
    after = everything(arena.database)
    changed = [name for name, rows in after.items() if rows != before[name]]
    found.require(not changed, f"bodies that were cut off changed {changed}")
    found.refused = "none was processed"
    return found


SCENARIOS: dict[str, Callable[[Arena], Tried]] = {
    "tenants": other_tenants,
    "hanging provider": hanging_provider,
    "lying provider": lying_provider,
    "truncated bodies": truncated_bodies,
    "forged trials": forged_trials,
    "noisy runner": noisy_runner,
    "harmful runner": harmful_runner,
    "strangers": strangers,
    "look-alikes": look_alikes,
    **{kind: flood(kind) for kind in load_isolation.FLOODS},
    "full disk": full_disk,
    "stopped broker": stopped_broker,
    "flushed broker": flushed_broker,
    "two processes": two_processes,
    "backups during kills": backups_during_kills,
    "killed supervisor": killed_supervisor,
}
