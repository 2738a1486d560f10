"""`make scenario NAME=gameday`: an hour with twelve faults; who was told, when, and the books.

A whole service with Prometheus, Alertmanager and our rules runs jobs that are submitted little by
little, while processes are killed and hang, the broker forgets, the disk fills up, a clock and a
network are wrong. Every alert that a fault asks for must be heard while it lasts and be over
afterwards; at the end every job was done once and every account is exact.
"""

import argparse
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any, Final

import httpx
from benchmarks.figures import tell
from scenarios.chaos.accounts import audited, wrongs
from scenarios.gameday.faults import ENGINE, FAULTS, Fault
from support.servers.prometheus import Receiver, alertmanager, prometheus, target_says
from support.servers.stacks import finished, running_stack, wait_until

from buildarena_backend.database.database import Database
from buildarena_cli.local.stack import Stack

HOUR_MIN: Final = 60.0
DISK: Final = "4g"
TASK: Final = "lift-1"
MODELS: Final = ("builtin/random", "builtin/expert")
ENDED_S: Final = 1800.0


class Day:
    """A game day.

    Args:
        stack: The service.
        receiver: Who is told alerts.
        faults: What goes wrong.
        minute_s: Seconds that a minute of the plan takes.
    """

    def __init__(
        self, stack: Stack, receiver: Receiver, faults: Sequence[Fault], minute_s: float
    ) -> None:
        self.stack, self.receiver, self.minute_s = stack, receiver, minute_s
        self.faults = faults
        self.began = time.time()
        self.spans: dict[str, tuple[float, float]] = {}

    def minutes(self) -> float:
        """Of the plan, since it began."""
        return (time.time() - self.began) / self.minute_s

    def sleep_until(self, minute: float) -> None:
        """Waits for a minute of the plan."""
        time.sleep(max(0.0, self.began + minute * self.minute_s - time.time()))

    def suffer(self, fault: Fault) -> None:
        """One fault, from its beginning to its end."""
        self.sleep_until(fault.at_min)
        begun = self.minutes()
        with fault.during(self.stack):
            self.sleep_until(begun + fault.lasts_min)
        self.spans[fault.name] = (begun, self.minutes())

    def submit(self, jobs: int, waves: int) -> list[str]:
        """Submits jobs little by little over the plan; the ids of their sweeps."""
        found = []
        last = max(fault.at_min for fault in self.faults)
        seeds = jobs // len(MODELS)
        for wave in range(waves):
            self.sleep_until(wave * last / waves)
            own = range(seeds * wave // waves, seeds * (wave + 1) // waves)
            found.append(self._submitted(wave, own))
        return found

    def _submitted(self, wave: int, seeds: range) -> str:
        spec = {"tasks": [TASK], "simulator": ENGINE, "worlds": 0, "name": f"wave {wave}"}
        body = {**spec, "models": list(MODELS), "seeds": list(seeds)}

        def submit() -> str | None:
            try:
                answer = httpx.post(
                    f"{self.stack.url}/v1/sweeps",
                    json=body,
                    headers={"Idempotency-Key": f"wave-{wave}"},
                    timeout=60,
                )
            except httpx.TransportError:
                return None
            return str(answer.json()["id"]) if answer.status_code == 202 else None

        return str(wait_until(submit, ENDED_S, f"wave {wave} is accepted"))

    def heard(self) -> list[dict[str, Any]]:
        """What operators were told: alert, and from when to when, minutes of the plan."""
        found: dict[tuple[str, str], dict[str, Any]] = {}
        for told in self.receiver.operators:
            name = told["labels"]["alertname"].removeprefix("BuildArena")
            row = found.setdefault((name, told["startsAt"]), {"alert": name})
            row["from_min"] = self._minute(told["startsAt"])
            if told["status"] == "resolved":
                row["to_min"] = self._minute(told["endsAt"])
        return sorted(found.values(), key=lambda row: float(row["from_min"]))

    def _minute(self, stamp: str) -> float:
        at = datetime.fromisoformat(stamp).timestamp()
        return round((at - self.began) / self.minute_s, 1)

    def judged(self) -> list[dict[str, Any]]:
        """Each fault with what was heard of it, and whether that is as it should be."""
        heard = self.heard()
        return [self._judged(fault, heard) for fault in self.faults]

    def _judged(self, fault: Fault, heard: Sequence[dict[str, Any]]) -> dict[str, Any]:
        begun, ended = self.spans[fault.name]
        told = [
            row
            for row in heard
            if row["alert"] == fault.alert and begun <= row["from_min"] <= ended + 1
        ]
        after = told[0]["from_min"] - begun if told else None
        over = [row["to_min"] for row in told if "to_min" in row]
        mended = fault.over_min is None or (bool(over) and max(over) <= ended + fault.over_min)
        right = fault.alert is None or (bool(told) and mended)
        return {
            "fault": fault.name,
            "from_min": round(begun, 1),
            "to_min": round(ended, 1),
            "alert": fault.alert,
            "heard_after_min": None if after is None else round(after, 1),
            "over_after_min": round(max(over) - ended, 1) if over else None,
            "right": right,
        }


@contextmanager
def own_disk(folder: Path) -> Iterator[Path]:
    """A small disk of its own, which can be filled."""
    subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={DISK},mode=755", "gameday", str(folder)], check=True
    )
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def day(
    folder: Path, *, jobs: int, faults: Sequence[Fault], minute_s: float, waits: bool
) -> dict[str, Any]:
    """Lives through a game day.

    Args:
        folder: For everything that the service keeps.
        jobs: How many are submitted.
        faults: What goes wrong.
        minute_s: Seconds that a minute of the plan takes.
        waits: Whether alerts fire as late as their rules say; else at once.

    Returns:
        What happened, and under ``wrong`` what should not have.
    """
    with ExitStack() as stack:
        service = stack.enter_context(
            running_stack(folder, lease_s=3.0, max_faults=1000, simulators=(ENGINE,))
        )
        place = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        receiver = stack.enter_context(alertmanager(place))
        client = stack.enter_context(
            prometheus(
                place, service.url, None, every_s=5, alertmanager=receiver.address, waits=waits
            )
        )
        target_says(client, "up")
        lived = Day(service, receiver, faults, minute_s)
        threads = [threading.Thread(target=lived.suffer, args=(fault,)) for fault in faults]
        for thread in threads:
            thread.start()
        sweeps = lived.submit(jobs, waves=max(1, min(len(faults), jobs // 8)))
        for thread in threads:
            thread.join()
        with httpx.Client(base_url=service.url, timeout=60) as api:
            ended = [finished(api, sweep, ENDED_S) for sweep in sweeps]
        _wait_for_silence(lived)
        with closing(Database(service.environment["BUILDARENA_DATABASE_URL"])) as database:
            wait_until(lambda: audited(database), 300, "all is verified that must be")
            books = wrongs(database)
    judged = lived.judged()
    expected = {fault.alert for fault in faults}
    return {
        "minutes": round(lived.minutes(), 1),
        "jobs_done": sum(sweep["progress"]["done"] for sweep in ended),
        "faults": judged,
        "also_heard": [row for row in lived.heard() if row["alert"] not in expected],
        "wrong": books | {row["fault"]: row["alert"] for row in judged if not row["right"]},
    }


def _wait_for_silence(lived: Day) -> None:
    """Until the alerts that faults ask for are over, or have gone on for too long."""
    mending = [(fault, fault.over_min) for fault in lived.faults if fault.over_min is not None]
    asked = {fault.alert for fault, _ in mending}
    until = max(lived.spans[fault.name][1] + over_min for fault, over_min in mending)
    while lived.minutes() < until:
        if all("to_min" in row for row in lived.heard() if row["alert"] in asked):
            return
        time.sleep(1)


def main() -> int:
    """Runs the hour.

    Returns:
        The exit code: 1 if an alert was not as it should be, or an account is wrong.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=2_000)
    parser.add_argument("--minutes", type=float, default=HOUR_MIN, help="how long the plan takes")
    parser.add_argument("--json", type=Path, help="where the figures go")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="buildarena-gameday-") as name:
        Path(name).chmod(0o755)
        with own_disk(Path(name)) as folder:
            found = day(
                folder,
                jobs=options.jobs,
                faults=FAULTS,
                minute_s=60 * options.minutes / HOUR_MIN,
                waits=options.minutes >= HOUR_MIN,
            )
    tell(found, options.json)
    return int(bool(found["wrong"]))


if __name__ == "__main__":
    raise SystemExit(main())
