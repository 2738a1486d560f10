"""What another key's light questions take while one key asks nothing but heavy ones.

A real API process with 20,000 ended jobs; 80 requesters of a hostile key ask for lists of 1,000
rows, text, boards with invented names and times, comparisons and replays of a session that goes
on, at once again whatever they are told. Another key asks for `GET /v1/jobs?limit=20` meanwhile,
and in turns without them. All three are processes of their own; the hostile one gives way to the
others on the processor, as on another machine it would take none of theirs. The rate limit is out
of reach: what is measured is how work is shared.
"""

import argparse
import asyncio
import http.client
import itertools
import json
import os
import random
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx
from benchmarks.figures import keep
from benchmarks.scale.bench_scale import api_process, servers
from benchmarks.scale.filling import TRACKS, Amount, fill
from support.clients.tenants import ADMIN
from support.machines.expert_calls import calls_of

from buildarena_store import Database

BAR = 3.0
"""The 99th percentile under the flood, in those of the same question alone."""
REQUESTERS = 80
LIGHT = "/v1/jobs?limit=20"
PAUSE_S = 0.01
KINDS = ("list", "text", "board", "comparison", "replay")


def hostile_paths(kind: str, session: str, seed: int) -> Iterator[str]:
    """Questions of a kind, each another one than all before."""
    rng = random.Random(seed)
    for number in itertools.count():
        name = f"{rng.getrandbits(64):x}"
        model = f"made-up/model-{rng.randrange(50)}"
        since = f"2025-01-0{rng.randrange(1, 8)}T00:{rng.randrange(60):02}:{rng.randrange(60):02}Z"
        yield {
            "list": (
                "/v1/jobs?limit=1000",
                f"/v1/jobs?limit=1000&model={model}",
                "/v1/jobs?limit=1000&sort=indicator",
                "/v1/jobs?limit=1000",
                f"/v1/jobs?limit=999&task={name}",
            ),
            "text": (
                f"/v1/jobs?text={name[:4]}",
                f"/v1/jobs?text={name}",
                f"/v1/jobs?text=lift&limit={rng.randrange(1, 1000)}",
            ),
            "board": (
                f"/v1/leaderboard?model={name}",
                f"/v1/leaderboard?track={name}",
                f"/v1/leaderboard?task={name}",
                f"/v1/leaderboard/figures?sweep={name}",
                f"/v1/leaderboard?since={since}",
            ),
            "comparison": (
                f"/v1/leaderboard/compare?first={model}&second=made-up/model-1",
                f"/v1/leaderboard/compare?first={name}&second={name}",
            ),
            "replay": (f"/v1/jobs/{session}/replay",),
        }[kind][number % {"replay": 1, "text": 3, "comparison": 2}.get(kind, 5)]


class Hostile:
    """So many requesters that ask again at once, whatever they are told."""

    def __init__(self, url: str, secret: str, session: str, until: float) -> None:
        self._host, self._port = urlsplit(url).hostname, urlsplit(url).port
        self._secret, self._session, self._until = secret, session, until
        self.answers: Counter[str] = Counter()

    async def keep_asking(self, kind: str, seed: int) -> None:
        """Asks for one kind until the time is over."""
        for path in hostile_paths(kind, self._session, seed):
            if time.monotonic() >= self._until:
                return
            try:
                async with asyncio.timeout_at(
                    asyncio.get_running_loop().time() + self._until - time.monotonic()
                ):
                    status = await self._ask("GET", path)
                self.answers[f"{kind} {status}"] += 1
            except TimeoutError:
                return
            except (OSError, IndexError):
                self.answers[f"{kind} broken"] += 1

    async def keep_building(self) -> None:
        """Calls a tool every now and then, so that the replay is another one."""
        body = json.dumps({"tool": "get_machine_summary", "arguments": {}})
        with_pauses = itertools.repeat(0.3)
        for pause_s in with_pauses:
            if time.monotonic() + pause_s >= self._until:
                return
            await asyncio.sleep(pause_s)
            await self._ask("POST", f"/v1/sessions/{self._session}/calls", body)

    async def _ask(self, method: str, path: str, body: str = "") -> int:
        reader, writer = await asyncio.open_connection(self._host, self._port)
        try:
            head = (
                f"{method} {path} HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {self._secret}\r\n"
                f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\n"
                "Connection: close\r\n\r\n"
            )
            writer.write((head + body).encode())
            status = int((await reader.readline()).split()[1])
            while await reader.read(1 << 18):
                pass
            return status
        finally:
            writer.close()


async def attack(url: str, secret: str, session: str, kinds: str, for_s: float) -> Counter[str]:
    """Lets the requesters loose for a time; what they were answered, by kind and status."""
    wanted = kinds.split(",")
    hostile = Hostile(url, secret, session, time.monotonic() + for_s)
    work = [hostile.keep_asking(wanted[n % len(wanted)], n) for n in range(REQUESTERS)]
    if "replay" in wanted:
        work.append(hostile.keep_building())
    await asyncio.gather(*work)
    return hostile.answers


def ask_light(url: str, secret: str, for_s: float) -> dict[str, Any]:
    """Asks the light question one after the other."""
    address, headers = urlsplit(url), {"Authorization": f"Bearer {secret}"}
    connection = http.client.HTTPConnection(address.hostname or "", address.port, timeout=60)
    times, failed, until = [], 0, time.monotonic() + for_s
    while time.monotonic() < until:
        start = time.perf_counter()
        connection.request("GET", LIGHT, headers=headers)
        answer = connection.getresponse()
        answer.read()
        times.append(1000 * (time.perf_counter() - start))
        failed += answer.status != 200
        time.sleep(PAUSE_S)
    return {"times": times, "failed": failed}


@contextmanager
def child(*words: str, patience: int = 0) -> Iterator[subprocess.Popen[str]]:
    """This program in a process of its own, which gives way to the others on the processor."""
    command = ["nice", "-n", str(patience), sys.executable, "-m", __spec__.name, *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        yield process


def told_by(process: subprocess.Popen[str]) -> Any:
    """What a process of ours wrote."""
    assert process.stdout is not None
    return json.loads(process.stdout.read())


def spread(times: list[float]) -> dict[str, float]:
    """Median and 99th percentile."""
    ranked = statistics.quantiles(times, n=100)
    return {
        "questions": len(times),
        "p50_ms": round(ranked[49], 1),
        "p99_ms": round(ranked[98], 1),
    }


def open_session(client: httpx.Client, secret: str) -> str:
    """A session with the expert's machine, whose replay takes long to make."""
    headers = {"Authorization": f"Bearer {secret}"}
    body = {"task": "lift-3", "agent": "hostile"}
    opened = client.post("/v1/sessions", json=body, headers=headers).raise_for_status()
    session: str = opened.json()["id"]
    for call in calls_of("lift-3"):
        client.post(f"/v1/sessions/{session}/calls", json=call, headers=headers).raise_for_status()
    return session


def new_secret(client: httpx.Client, name: str) -> str:
    """The secret of a new key."""
    body = {"name": name, "scopes": ["submit"]}
    headers = {"Authorization": f"Bearer {ADMIN}"}
    made = client.post("/v1/keys", json=body, headers=headers).raise_for_status()
    secret: str = made.json()["secret"]
    return secret


def measure(folder: Path, jobs: int, rounds: int, for_s: float, kinds: str) -> dict[str, Any]:
    """Fills a database and asks, in turns alone and under the flood."""
    with servers(folder) as settings:
        database = Database(settings["BUILDARENA_DATABASE_URL"])
        fill(database, Amount(ended=jobs, queued=0))
        database.close()
        settings |= {
            "BUILDARENA_REQUIRE_KEYS": "true",
            "BUILDARENA_ADMIN_KEY": ADMIN,
            "BUILDARENA_RATE_LIMIT": "10000000/minute",
        }
        with api_process(settings) as (client, _, _):
            url = str(client.base_url).rstrip("/")
            hostile, light = new_secret(client, "hostile"), new_secret(client, "light")
            session = open_session(client, hostile)
            ask_light(url, light, 2.0)
            times: dict[str, list[float]] = {"alone": [], "under_the_flood": []}
            answers: Counter[str] = Counter()
            failed = 0
            for _ in range(rounds):
                with child("light", url, light, str(for_s)) as asking:
                    alone = told_by(asking)
                words = ("attack", url, hostile, session, kinds, str(for_s + 2))
                with child(*words, patience=10) as attacking:
                    time.sleep(1.0)
                    with child("light", url, light, str(for_s)) as asking:
                        flooded = told_by(asking)
                    answers.update(told_by(attacking))
                times["alone"] += alone["times"]
                times["under_the_flood"] += flooded["times"]
                failed += alone["failed"] + flooded["failed"]
    figures = {name: spread(values) for name, values in times.items()}
    ratio = figures["under_the_flood"]["p99_ms"] / figures["alone"]["p99_ms"]
    return {
        "jobs": jobs,
        "requesters": REQUESTERS,
        "kinds": kinds,
        "track": TRACKS[0],
        **figures,
        "failed": failed,
        "p99_ratio": round(ratio, 2),
        "bar": BAR,
        "of_the_bar": round(ratio / BAR, 2),
        "answers_to_the_hostile": dict(sorted(answers.items())),
        "load_average": [round(value, 1) for value in os.getloadavg()],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--jobs", type=int, default=20_000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=10.0, help="of each turn")
    parser.add_argument("--kinds", default=",".join(KINDS))
    given = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="buildarena-bench-"))
    try:
        result = measure(folder, given.jobs, given.rounds, given.seconds, given.kinds)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    for name, value in result.items():
        sys.stdout.write(f"{name:<24} {value}\n")
    keep(result, given.json)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["attack", url, secret, session, kinds, for_s]:
            told = asyncio.run(attack(url, secret, session, kinds, float(for_s)))
            sys.stdout.write(json.dumps(told))
        case ["light", url, secret, for_s]:
            sys.stdout.write(json.dumps(ask_light(url, secret, float(for_s))))
        case _:
            main()
