"""Who was heard of when: how long a host takes to come back after its link was mended."""

import threading
import time
from contextlib import suppress

import httpx
from scenarios.hosts.network import HOSTS, move_into
from scenarios.hosts.service import API, Service
from sqlalchemy import text
from support.clients.tenants import ADMIN

EVERY_S = 0.25
ASK_S = 3.0
"""How long one question to the API may take, so that it is asked again soon."""
NEEDS = {
    "database": ("api", "construct", "simulator", "runner"),
    "api": ("api", "runner"),
    "construct": ("construct",),
    "simulator": ("simulator",),
    "runner": ("runner",),
}
"""Which hosts can do nothing while a link is down."""


class Watch:
    """Looks at the register of workers from the database's own host, and asks the API for jobs."""

    def __init__(self, service: Service) -> None:
        self.seen: dict[str, float] = dict.fromkeys(HOSTS, 0.0)
        self.waiting = 0
        self._database = service.database
        self._over = threading.Event()
        self._threads = [
            threading.Thread(target=self._read_register, name="register"),
            threading.Thread(target=self._ask, name="asking"),
        ]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Ends the threads."""
        self._over.set()
        for thread in self._threads:
            thread.join()

    def is_back(self, host: str, since: float) -> bool:
        """Whether everything that needs a host's link was heard of after a moment."""
        return all(self.seen[other] > since for other in NEEDS[host])

    def _read_register(self) -> None:
        move_into("database")
        while not self._over.wait(EVERY_S):
            with self._database.statement() as connection:
                query = "SELECT host, extract(epoch FROM max(seen_at)) FROM workers GROUP BY host"
                for host, at in connection.execute(text(query)):
                    # A runner's name ends with its process.
                    self.seen[host.partition("-")[0]] = float(at)
                count = "SELECT count(*) FROM jobs WHERE state <> 'done'"
                self.waiting = connection.execute(text(count)).scalar_one()

    def _ask(self) -> None:
        headers = {"Authorization": f"Bearer {ADMIN}"}
        while not self._over.wait(EVERY_S):
            asked = time.time()
            with suppress(httpx.TransportError):
                answer = httpx.get(f"{API}/v1/jobs?limit=1", headers=headers, timeout=ASK_S)
                if answer.status_code == 200:
                    self.seen["api"] = asked
