"""Links that are taken down at random, and how long it takes until all is well again."""

import random
import threading
import time
from dataclasses import dataclass, field

from scenarios.hosts.network import HOSTS, Network
from scenarios.hosts.watch import Watch

LONGEST_S = 60.0
"""A link of each round is down for so long, the others for a second or more."""
TWO = 0.25
"""Share of cuts that take a second host down with the first."""
AT_ONCE = 0.5
"""Share of cuts after which the next one does not wait until all is well."""
PATIENCE_S = 90.0


@dataclass(slots=True)
class Cut:
    """Hosts without a link.

    Attributes:
        hosts: Which.
        seconds: For how long.
        at: When it began.
        recovery_s: From its end until everybody was heard of; None where that was not waited for.
    """

    hosts: list[str]
    seconds: float
    at: float
    recovery_s: float | None = None


@dataclass
class Cuts:
    """Cuts links from a thread until it is stopped; then all links are up."""

    network: Network
    watch: Watch
    rng: random.Random
    made: list[Cut] = field(default_factory=list)
    _over: threading.Event = field(default_factory=threading.Event)

    def start(self) -> None:
        """Starts the thread."""
        self._thread = threading.Thread(target=self._cut_on, name="cuts")
        self._thread.start()

    def stop(self) -> None:
        """Mends what is cut."""
        self._over.set()
        self._thread.join()

    def _cut_on(self) -> None:
        turn: list[tuple[str, float]] = []
        while not self._over.wait(self.rng.uniform(0.5, 6)):
            if not turn:
                # Every host in turn, one of them for as long as there is.
                longest = self.rng.choice(list(HOSTS))
                turn = [
                    (host, LONGEST_S if host == longest else LONGEST_S ** self.rng.random())
                    for host in self.rng.sample(list(HOSTS), len(HOSTS))
                ]
            self._cut(*turn.pop())

    def _cut(self, host: str, seconds: float) -> None:
        hosts = [host]
        if self.rng.random() < TWO:
            hosts.append(self.rng.choice([other for other in HOSTS if other != host]))
        cut = Cut(hosts=hosts, seconds=seconds, at=time.time())
        for one in hosts:
            self.network.take_down(one)
        self._over.wait(seconds)
        cut.seconds = time.time() - cut.at
        for one in hosts:
            self.network.put_up(one)
        self.made.append(cut)
        if self._over.is_set() or self.rng.random() >= AT_ONCE:
            cut.recovery_s = self._recovery_s(hosts)

    def _recovery_s(self, hosts: list[str]) -> float:
        mended = time.time()
        while time.time() - mended < PATIENCE_S:
            if all(self.watch.is_back(host, mended) for host in hosts):
                break
            time.sleep(0.05)
        return time.time() - mended
