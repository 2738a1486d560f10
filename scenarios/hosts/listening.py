"""A listener to a sweep's events, as a page is one: it goes on from where it was cut off."""

import json
import threading
from collections import Counter

import httpx
from scenarios.hosts.service import API
from support.clients.tenants import ADMIN

SILENT_S = 20.0
"""A stream that lives gives a sign of it every 15 s."""


class Listener(threading.Thread):
    """Listens until it heard of every job's end, or is stopped.

    Args:
        sweep: Whose events.
        jobs: How many jobs it has.

    Attributes:
        heard: How often each event came, by its id.
        done: Jobs that were told to be done.
        streams: How often it began to listen.
    """

    def __init__(self, sweep: str, jobs: int) -> None:
        super().__init__(name=f"listener-{sweep}", daemon=True)
        self.sweep = sweep
        self.heard: Counter[int] = Counter()
        self.done: set[str] = set()
        self.streams = 0
        self._jobs, self._last = jobs, 0
        self._over = threading.Event()

    @property
    def heard_all(self) -> bool:
        """Whether it heard of every job's end."""
        return len(self.done) == self._jobs

    def stop(self) -> None:
        """Has it end after the next line that comes."""
        self._over.set()

    def run(self) -> None:
        """Listens, again and again."""
        headers = {"Authorization": f"Bearer {ADMIN}"}
        with httpx.Client(base_url=API, headers=headers, timeout=SILENT_S) as client:
            while not (self._over.is_set() or self.heard_all):
                try:
                    self._listen(client)
                except httpx.TransportError:
                    self._over.wait(1)

    def _listen(self, client: httpx.Client) -> None:
        since = {"Last-Event-ID": str(self._last)}
        with client.stream("GET", f"/v1/sweeps/{self.sweep}/events", headers=since) as stream:
            if stream.status_code != 200:
                self._over.wait(1)
                return
            self.streams += 1
            event: dict[str, str] = {}
            for line in stream.iter_lines():
                if self._over.is_set() or self.heard_all:
                    return
                name, _, value = line.partition(": ")
                if line:
                    event[name] = value
                elif "id" in event:
                    self._hear(event)
                    event = {}

    def _hear(self, event: dict[str, str]) -> None:
        self._last = int(event["id"])
        self.heard[self._last] += 1
        if event["event"] == "done" and (job := json.loads(event["data"])["job"]) is not None:
            self.done.add(job)
