"""`make test-hosts`: the service on five hosts whose links are slow, narrow and cut at random.

Database, broker and an S3 store; the API; a construct worker; a simulation worker beside the
database; and a runner, which reaches the API alone. At the end the books are exact: nothing is
lost, and nothing was done or paid for twice.
"""

import argparse
import json
import random
import shutil
import signal
import sys
import time
from contextlib import ExitStack, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import httpx
from scenarios.chaos.accounts import audited
from scenarios.hosts.books import PAID_MODEL, differences, figures, paid_twice, tracebacks, wrongs
from scenarios.hosts.cuts import Cuts
from scenarios.hosts.listening import Listener
from scenarios.hosts.network import PLACE, Network, enter_private_namespaces, inside
from scenarios.hosts.service import ENGINE, Service
from scenarios.hosts.watch import Watch
from support.servers.stacks import wait_until

TASK = "lift-1"
MIX = {PAID_MODEL: 6, "builtin/random": 2}
"""Jobs of a sweep by model: a paid one, and one whose sessions mostly end early."""
WAITING = 24
"""As many jobs are kept waiting, so that there is work wherever a link is cut."""
END_WITHIN_S = 420
RECOVERY_BAR_S = 30.0
DELAY_S, RATE = 0.05, "20mbit"


def say(words: str) -> None:
    """Tells whoever watches."""
    sys.stdout.write(f"{time.strftime('%H:%M:%S')} {words}\n")
    sys.stdout.flush()


def submit(client: httpx.Client, number: int) -> list[Listener]:
    """Submits a sweep for each model, again and again until it is accepted; who listens to them."""
    listeners = []
    for model, jobs in MIX.items():
        payload = {
            "name": f"hosts {number}",
            "tasks": [TASK],
            "models": [model],
            "simulator": ENGINE,
            "seeds": list(range(number * jobs, (number + 1) * jobs)),
            "budget": {"max_requests": 1_000_000},
        }
        key = {"Idempotency-Key": f"{model}-{number}"}

        def ask(payload: dict[str, Any] = payload, key: dict[str, str] = key) -> str | None:
            with suppress(httpx.TransportError):
                answer = client.post("/v1/sweeps", json=payload, headers=key)
                if answer.status_code == 202:
                    return str(answer.json()["id"])
                assert answer.status_code in {429, 500, 502, 503, 504}, answer.text
            return None

        sweep = wait_until(ask, 200, f"sweep {number} of {model} is accepted")
        listeners.append(Listener(str(sweep), jobs))
        listeners[-1].start()
    return listeners


def keep_busy(service: Service, network: Network, watch: Watch, seconds: float) -> list[Listener]:
    """Submits sweeps for so long; who listens to them."""
    sweeps: list[Listener] = []
    ends, number = time.monotonic() + seconds, 0
    while time.monotonic() < ends:
        service.require_running()
        network.require_wires()
        if watch.waiting < WAITING:
            sweeps += submit(service.client, number)
            number += 1
        time.sleep(0.5)
    return sweeps


def all_done(service: Service, sweeps: list[Listener]) -> bool:
    """Whether the API says so of every sweep."""
    service.require_running()
    for sweep in sweeps:
        with suppress(httpx.TransportError):
            answer = service.client.get(f"/v1/sweeps/{sweep.sweep}")
            if answer.status_code == 200 and answer.json()["state"] == "done":
                continue
        time.sleep(0.5)
        return False
    return True


def examined(
    service: Service, cuts: Cuts, sweeps: list[Listener], ended_s: float
) -> dict[str, Any]:
    """What was found; `wrong` is empty when all is well."""
    with inside("database"):
        found = figures(service.database, service.logs)
        wait_until(lambda: audited(service.database), 600, "all is verified that must be")
        wrong: dict[str, Any] = dict(wrongs(service.database))
        extra, most = paid_twice(service.database, service.standin)
        compared, different = differences(service.database, TASK, ENGINE)
    if not 0 <= extra <= most:
        wrong["answers that were paid for and are in no journal"] = f"{extra}, at most {most}"
    if different:
        wrong["jobs that differ from an undisturbed run"] = different[:10]
    if compared != len(sweeps) // len(MIX) * sum(MIX.values()):
        wrong["jobs that were submitted and jobs that are there"] = [len(sweeps), compared]
    for host in ("simulator", "runner"):
        if not any(host in name and name.endswith("done") for name in found["attempts"]):
            wrong[f"trials of the {host}"] = found["attempts"]
    if missed := [one.sweep for one in sweeps if not one.heard_all]:
        wrong["sweeps whose listeners did not hear of every job's end"] = missed
    if twice := {id_: n for one in sweeps for id_, n in one.heard.items() if n > 1}:
        wrong["events that were heard twice"] = twice
    if unforeseen := tracebacks(service.logs):
        wrong["tracebacks in logs"] = unforeseen
    recoveries = [cut.recovery_s for cut in cuts.made if cut.recovery_s is not None]
    if max(recoveries, default=0.0) > RECOVERY_BAR_S:
        wrong[f"recoveries of more than {RECOVERY_BAR_S:.0f} s"] = [
            asdict(cut) for cut in cuts.made if (cut.recovery_s or 0) > RECOVERY_BAR_S
        ]
    return {
        "cuts": [asdict(cut) for cut in cuts.made],
        "longest_recovery_s": round(max(recoveries, default=0.0), 1),
        "ended_after_s": round(ended_s, 1),
        "requests_of_models": {
            "answered": service.standin.counts.answered,
            "in_no_journal": extra,
            "of_at_most": most,
        },
        "event_streams": {
            "sweeps": len(sweeps),
            "opened": sum(one.streams for one in sweeps),
            "events": sum(one.heard.total() for one in sweeps),
        },
        "compared_with_undisturbed": compared,
        **found,
        "wrong": wrong,
    }


def run(minutes: float, seed: int, logs: Path) -> dict[str, Any]:
    """Runs it; returns what was found."""
    with ExitStack() as stack:
        network = Network(delay_s=DELAY_S, rate=RATE)
        stack.callback(network.close)
        say(f"five hosts, {DELAY_S * 1000:.0f} ms from any to any, {RATE}")
        service = stack.enter_context(Service(logs))
        watch = Watch(service)
        stack.callback(watch.close)
        # A worker that can't reach the database when it starts says so and ends.
        wait_until(lambda: watch.is_back("database", 0.0), 90, "all programs are at work")
        say("all programs are at work")
        cuts = Cuts(network=network, watch=watch, rng=random.Random(seed))
        sweeps = submit(service.client, 1_000)
        cuts.start()
        try:
            sweeps += keep_busy(service, network, watch, minutes * 60)
        finally:
            cuts.stop()
        stack.callback(lambda: [one.stop() for one in sweeps])
        say(f"{len(cuts.made)} cuts, all links are up; {watch.waiting} jobs wait")
        started = time.monotonic()
        wait_until(lambda: all_done(service, sweeps), END_WITHIN_S, "all jobs end")
        ended_s = time.monotonic() - started
        with suppress(AssertionError):
            wait_until(lambda: all(one.heard_all for one in sweeps), 60, "listeners hear of all")
        say("all jobs have ended; comparing with undisturbed runs")
        return examined(service, cuts, sweeps, ended_s)


def main() -> None:
    """Prints a summary and writes it all as JSON; exit code 1 when something is wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=18)
    parser.add_argument("--json", type=Path, required=True)
    given = parser.parse_args()
    given.json = given.json.absolute()
    enter_private_namespaces()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    logs, kept = PLACE / "logs", given.json.with_suffix(".logs")
    logs.mkdir()
    shutil.rmtree(kept, ignore_errors=True)
    given.json.parent.mkdir(parents=True, exist_ok=True)
    found: dict[str, Any] = {"wrong": "it did not come to its end"}
    try:
        found = run(given.minutes, given.seed, logs)
    finally:
        if found["wrong"]:
            shutil.copytree(logs, kept)
            say(f"logs are in {kept}")
    given.json.write_text(json.dumps({"seed": given.seed, **found}, indent=2) + "\n")
    summary = {name: value for name, value in found.items() if name != "cuts"}
    for cut in found["cuts"]:
        back = "" if cut["recovery_s"] is None else f", well again after {cut['recovery_s']:.1f} s"
        say(f"cut {' and '.join(cut['hosts'])} for {cut['seconds']:.1f} s{back}")
    sys.stdout.write(json.dumps(summary, indent=2) + "\n")
    sys.exit(1 if found["wrong"] else 0)


if __name__ == "__main__":
    main()
