"""Floods by one key, and what another key's requests take meanwhile.

`python -m scenarios.attack.load_isolation` starts an API of its own and prints a line for each
flood. The attacker is a process of its own, so that it does not slow the measurement itself.
"""

import asyncio
import itertools
import resource
import statistics
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import httpx
import psutil
from sqlalchemy import text
from support.clients.tenants import ADMIN
from support.servers.api_process import Service, api_service

from buildarena_backend.database.database import Database
from buildarena_benchmark import builtin_tasks

JOBS = 1000
FLOODS = {
    "streams": 800,
    "verifications": 1500,
    "exports": 200,
    "boards": 400,
    "half requests": 20_000,
}
"""How many requests of each kind are open at once."""
HALF = b"GET /v1/jobs HTTP/1.1\r\nHost: x\r\nX-More: "
HEALTH_BOUND_S = 1.0
"""Beside half requests, which need no key, the service's health is asked for over connections of
its own, as probes do."""
P99_BOUND_S = 0.25
RETRY_S = 1.0
"""How soon the attacker asks again, whatever it was told."""

MIN_ASKED = 2
"""Answers that quantiles need."""


@dataclass(frozen=True, kw_only=True)
class Tenants:
    """A service with two tenants and something to ask for."""

    service: Service
    attacker: str
    innocent: str
    sweep: str


@dataclass(frozen=True, kw_only=True)
class Measured:
    """What came of a flood.

    Attributes:
        answers: The attacker's answers by status.
        p50_s: Median of the innocent's requests, in seconds.
        p99_s: Their 99th percentile.
        longest_s: The longest.
        failed: The innocent's requests that were not answered with 200.
        memory_mib: The API process' memory at the end.
    """

    answers: dict[str, int]
    p50_s: float
    p99_s: float
    longest_s: float
    failed: int
    memory_mib: float


@contextmanager
def tenants(jobs: int = JOBS) -> Iterator[Tenants]:
    """An API process that asks for keys, with a scored sweep of the attacker's."""
    environment = {
        "BUILDARENA_REQUIRE_KEYS": "true",
        "BUILDARENA_ADMIN_KEY": ADMIN,
        "BUILDARENA_RATE_LIMIT": "1000000/minute",
    }
    with api_service(environment) as service, httpx.Client(base_url=service.url) as client:
        secrets = []
        for name in ("attacker", "innocent"):
            made = client.post(
                "/v1/keys",
                json={"name": name, "scopes": ["submit"]},
                headers={"Authorization": f"Bearer {ADMIN}"},
            )
            secrets.append(made.raise_for_status().json()["secret"])
        attacker, innocent = secrets
        sweep = client.post(
            "/v1/sweeps",
            json={"tasks": ["support-1"], "models": ["builtin/idle"], "samples": jobs},
            headers={"Authorization": f"Bearer {attacker}"},
            timeout=60,
        )
        yield Tenants(
            service=service,
            attacker=attacker,
            innocent=innocent,
            sweep=sweep.raise_for_status().json()["id"],
        )


def score_all(tenants: Tenants) -> None:
    """Ends every job with a score, as only scored ones can be verified."""
    database = Database(tenants.service.database_url)
    with database.transaction() as connection:
        connection.execute(
            text(
                "UPDATE jobs SET state = 'done', outcome = 'unsuccessful', success = 0,"
                " indicator = 0, metrics = '{}', finished_at = now()"
            )
        )
    database.close()


def flood(tenants: Tenants, kind: str, count: int, *, for_s: float) -> Measured:
    """Lets the attacker loose and asks as the innocent meanwhile."""
    path = "/v1/health" if kind == "half requests" else "/v1/jobs"
    words = [kind, str(count), str(for_s), tenants.service.url, tenants.attacker, tenants.sweep]
    with subprocess.Popen(
        [sys.executable, __file__, *words], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()  # it is about to begin
        times, failed = _ask(tenants, path, for_s)
        told = process.stdout.readline().split()
    answers = dict(zip(told[::2], map(int, told[1::2]), strict=True))
    memory = psutil.Process(tenants.service.pid).memory_info().rss / 2**20
    ranked = statistics.quantiles(times, n=100)
    return Measured(
        answers=answers,
        p50_s=ranked[49],
        p99_s=ranked[98],
        longest_s=max(times),
        failed=failed,
        memory_mib=memory,
    )


def _ask(tenants: Tenants, path: str, for_s: float) -> tuple[list[float], int]:
    headers = {"Authorization": f"Bearer {tenants.innocent}"}
    if path == "/v1/health":
        headers["Connection"] = "close"
    times, failed = [], 0
    end = time.monotonic() + for_s
    with httpx.Client(base_url=tenants.service.url, headers=headers, timeout=30) as client:
        while len(times) < MIN_ASKED or time.monotonic() < end:
            started = time.monotonic()
            try:
                failed += client.get(path).status_code != 200
            except httpx.TransportError:
                failed += 1
            times.append(time.monotonic() - started)
            time.sleep(0.02)
    return times, failed


class _Attacker:
    """Keeps so many requests open until its time is over."""

    def __init__(self, url: str, secret: str, until: float) -> None:
        self._address = httpx.URL(url)
        self._secret = secret
        self._until = until
        self.answers: Counter[str] = Counter()

    async def keep_asking(self, method: str, path: str) -> None:
        while (left := self._until - time.monotonic()) > 0:
            try:
                async with asyncio.timeout(left):
                    await self._ask(method, path)
            except TimeoutError:
                return
            except OSError:
                self.answers["broken"] += 1
            await asyncio.sleep(RETRY_S)

    async def _ask(self, method: str, path: str) -> None:
        reader, writer = await asyncio.open_connection(self._address.host, self._address.port)
        try:
            if not path:
                writer.write(HALF)
                self.answers["closed" if not await reader.read(1) else "answered"] += 1
                return
            head = (
                f"{method} {path} HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {self._secret}\r\n"
            )
            writer.write(f"{head}Content-Length: 0\r\nConnection: close\r\n\r\n".encode())
            words = (await reader.readline()).decode().split()
            self.answers[words[1] if words else "closed"] += 1
            while await reader.read(1 << 16):
                pass
        finally:
            writer.close()


def _paths(kind: str, count: int, url: str, secret: str, sweep: str) -> list[tuple[str, str]]:
    if kind == "verifications":
        headers = {"Authorization": f"Bearer {secret}"}
        params = {"sweep": sweep, "limit": 200}
        jobs = httpx.get(f"{url}/v1/jobs", params=params, headers=headers, timeout=30).json()
        ids = [job["id"] for job in jobs["data"]]
        return [("POST", f"/v1/jobs/{ids[n % len(ids)]}/verify") for n in range(count)]
    if kind == "half requests":
        return [("GET", "")] * count
    path = {
        "streams": f"/v1/sweeps/{sweep}/events",
        "exports": f"/v1/sweeps/{sweep}/results",
    }
    if kind in path:
        return [("GET", path[kind])] * count
    pairs = itertools.cycle(itertools.combinations(sorted(builtin_tasks()), 2))
    some = itertools.islice(pairs, count)
    return [("GET", f"/v1/leaderboard?task={one}&task={other}") for one, other in some]


async def _attack(words: list[str]) -> Counter[str]:
    kind, count, for_s, url, secret, sweep = words
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    asked = _paths(kind, int(count), url, secret, sweep)
    sys.stdout.write("begins\n")
    sys.stdout.flush()
    attacker = _Attacker(url, secret, time.monotonic() + float(for_s))
    await asyncio.gather(*(attacker.keep_asking(*one) for one in asked))
    return attacker.answers


def main() -> None:
    """Prints what each flood came to; exits with 1 when one slowed the innocent too much."""
    slow = False
    with tenants() as both:
        for kind, count in FLOODS.items():
            if kind == "verifications":
                score_all(both)
            found = flood(both, kind, count, for_s=30 if kind == "half requests" else 10)
            is_slow = (
                found.longest_s > HEALTH_BOUND_S
                if kind == "half requests"
                else found.p99_s > P99_BOUND_S
            )
            slow = slow or is_slow or found.failed > 0
            sys.stdout.write(
                f"{kind:<14} {count:>5} at once   innocent p50 {found.p50_s * 1000:5.0f} ms"
                f"   p99 {found.p99_s * 1000:5.0f} ms"
                f"   longest {found.longest_s * 1000:5.0f} ms   failed {found.failed}"
                f"   API {found.memory_mib:4.0f} MiB   answers {found.answers}\n"
            )
            sys.stdout.flush()
    sys.exit(1 if slow else 0)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        counted = asyncio.run(_attack(sys.argv[1:7]))
        sys.stdout.write(" ".join(f"{name} {times}" for name, times in counted.items()) + "\n")
    else:
        main()
