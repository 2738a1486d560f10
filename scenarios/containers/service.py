"""The service as people outside see it: HTTPS through the proxy, with a key."""

import ssl
import time
from collections import Counter
from pathlib import Path
from typing import Any

import httpx
from scenarios.containers.engine import Project

ENDED = "done"
EXPECTED = {"silent workers"}
"""Checks of health that fail because of what the scenario does."""


class Service:
    """A client of one project's service, which trusts its proxy's own authority alone."""

    def __init__(self, project: Project, port: int, key: str, folder: Path) -> None:
        self.url = f"https://localhost:{port}"
        self.key = key
        self.authority = folder / f"{project.name}-root.crt"
        self.project = project
        proxy = project.containers("proxy")[0]
        deadline = time.monotonic() + 60
        inside = "/data/caddy/pki/authorities/local/root.crt"
        while not self.authority.exists():
            assert time.monotonic() < deadline, "the proxy made no certificate"
            project.engine.run("cp", f"{proxy}:{inside}", str(self.authority), check=False)
            time.sleep(0.2)
        trust = ssl.create_default_context(cafile=str(self.authority))
        self.client = httpx.Client(
            base_url=self.url,
            verify=trust,
            headers={"Authorization": f"Bearer {key}"},
            timeout=30,
            transport=httpx.HTTPTransport(verify=trust, retries=3),
        )

    def ask(self, method: str, path: str, **words: Any) -> httpx.Response:
        """An answer; while the service is being restarted, asked again."""
        deadline = time.monotonic() + 90
        while True:
            try:
                answer = self.client.request(method, path, **words)
                if answer.status_code not in {502, 503, 504}:
                    return answer
            except httpx.TransportError:
                pass
            assert time.monotonic() < deadline, f"{method} {path} was not answered"
            time.sleep(0.3)

    def get(self, path: str, **params: Any) -> Any:
        answer = self.ask("GET", path, params=params)
        assert answer.status_code == 200, answer.text
        return answer.json()

    def wait_up(self, within_s: float = 120) -> None:
        deadline = time.monotonic() + within_s
        while True:
            health = self.ask("GET", "/v1/health").json()
            # Workers that were killed here count for an hour, also where the database is restored.
            bad = [c for c in health["checks"] if not c["ok"] and c["name"] not in EXPECTED]
            bad = [check for check in bad if not check["name"].startswith("disk")]
            if not bad:
                return
            if time.monotonic() > deadline:
                raise AssertionError(bad, self.project.compose("logs", "--tail", "40"))
            time.sleep(0.3)

    def submit(self, sweep: dict[str, Any]) -> str:
        answer = self.ask("POST", "/v1/sweeps", json=sweep)
        assert answer.status_code in {200, 201}, answer.text
        return str(answer.json()["id"])

    def ended(self, sweep: str) -> tuple[int, int]:
        progress = self.get(f"/v1/sweeps/{sweep}")["progress"]
        return progress["done"], progress["total"]

    def wait_ended(self, sweep: str, share: float = 1.0, within_s: float = 900) -> None:
        deadline = time.monotonic() + within_s
        while True:
            done, total = self.ended(sweep)
            if done >= share * total:
                return
            assert time.monotonic() < deadline, f"{done} of {total} jobs ended"
            time.sleep(0.5)

    def jobs(self, sweep: str) -> list[dict[str, Any]]:
        return list(self.get("/v1/jobs", sweep=sweep, limit=200)["data"])

    def outcomes(self, sweep: str) -> Counter[str]:
        return Counter(str(job["outcome"]) for job in self.jobs(sweep))

    def verify(self, jobs: list[str], within_s: float = 1200) -> Counter[bool]:
        """Replays and simulates jobs again; how many gave every figure anew."""
        deadline = time.monotonic() + within_s
        waiting, found = list(jobs), Counter[bool]()
        open_: set[str] = set()
        while waiting or open_:
            while waiting and len(open_) < 20:
                answer = self.ask("POST", f"/v1/jobs/{waiting[0]}/verify")
                if answer.status_code == 429:
                    break
                assert answer.is_success, answer.text
                open_.add(str(answer.json()["id"]))
                waiting.pop(0)
            for one in sorted(open_):
                shown = self.get(f"/v1/verifications/{one}")
                if shown["state"] == ENDED:
                    found[bool(shown["report"]["ok"])] += 1
                    open_.remove(one)
            assert time.monotonic() < deadline, f"{len(open_) + len(waiting)} are not verified"
            time.sleep(0.3)
        return found
