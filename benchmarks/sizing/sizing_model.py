"""What a number of sessions at once needs: the measured costs, multiplied.

Sessions are alike: each turn waits for its model and costs what was measured, and a job is so many
turns and its trials. Costs are means on processors like the ones that were measured on; a part is
planned for the share of a processor in USED, so that queues stay short. Print it: `make sizing`.
"""

import argparse
import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from buildarena_api.app import MAX_CONNECTIONS
from buildarena_pipeline.runtime.worker_process import CONNECTIONS_OF_FORKS, CONNECTIONS_OF_THREADS

COSTS: Final = Path(__file__).with_name("costs.json")
USED: Final = 0.6
"""Share of a processor that a part is planned for."""
SESSIONS_PER_PROCESS: Final = 1000
"""Sessions that one construct process was measured with."""
CORES_PER_SIMULATOR: Final = 2
DAY_S: Final = 86_400
MEASURED_LEASE_S: Final = 10.0
COMMANDS_PER_VALKEY: Final = 100_000
"""Commands a second that one Valkey, which has one thread for them, is trusted with."""
POSTGRES_CONNECTIONS: Final = 500
"""More than these want a pooler between processes and Postgres."""
POSTGRES_CORES: Final = 32
POSTGRES_LOG_MB_S: Final = 100.0
"""Above these one Postgres is not planned for: a machine's cores, and what replicas can follow."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """What is planned for.

    Attributes:
        sessions: Sessions at once.
        reply_s: How long a model takes for a reply.
        lease_s: How long leases are; heartbeats come four times in it.
        trial_factor: Trials' cost against the measured ones: other tasks, closed loops.
    """

    sessions: int
    reply_s: float = 20.0
    lease_s: float = 10.0
    trial_factor: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Need:
    """What a load needs.

    Attributes:
        turns_s: Model requests a second.
        jobs_day: Jobs a day.
        construct: Construct processes.
        simulators: Simulation workers of two trials at once.
        api: API processes, for the service's own sake; people's reading comes on top.
        postgres_connections: Connections that all processes together may open.
        postgres_cores: Cores that Postgres uses.
        postgres_log_mb_s: Megabytes a second of its log.
        postgres_gb_day: Gigabytes a day that its tables grow.
        valkey_share: Share of one Valkey's bearable commands.
        artifacts_gb_day: Gigabytes a day of artifacts.
    """

    turns_s: float
    jobs_day: float
    construct: int
    simulators: int
    api: int
    postgres_connections: int
    postgres_cores: float
    postgres_log_mb_s: float
    postgres_gb_day: float
    valkey_share: float
    artifacts_gb_day: float

    @property
    def limits(self) -> list[str]:
        """Parts that one server no longer bears."""
        found = []
        if self.postgres_connections > POSTGRES_CONNECTIONS:
            found.append("Postgres' connections: a pooler")
        if self.postgres_cores > POSTGRES_CORES * USED:
            found.append("Postgres' processors")
        if self.postgres_log_mb_s > POSTGRES_LOG_MB_S * USED:
            found.append("Postgres' log")
        if self.valkey_share > USED:
            found.append("Valkey")
        return found


def connections(*, api: int, construct: int, trials: int) -> int:
    """Connections to Postgres that processes may open.

    Args:
        api: API processes.
        construct: Construct processes.
        trials: Trials that simulation workers run at once; each is a process.
    """
    forks = trials * 2 * CONNECTIONS_OF_FORKS
    return api * MAX_CONNECTIONS + construct * CONNECTIONS_OF_THREADS + forks


def need(load: Load, costs: dict[str, Any]) -> Need:
    """Multiplies costs."""
    turn, second = costs["per_turn"], costs["per_session_s"]
    own_s = (turn["construct worker cpu_ms"] + turn["postgres cpu_ms"]) / 1000
    turns_s = load.sessions / (load.reply_s + own_s)
    beats = MEASURED_LEASE_S / load.lease_s

    def per_s(name: str) -> float:
        """Use in a second: by turns, and by seconds of sessions, which are heartbeats."""
        return float(turns_s * turn[name] + load.sessions * second[name] * beats)

    jobs_s = turns_s / costs["turns_per_job"]
    trial_cores = turns_s * turn["mujoco worker cpu_ms"] * load.trial_factor / 1000
    construct = max(
        math.ceil(load.sessions / SESSIONS_PER_PROCESS),
        math.ceil(per_s("construct worker cpu_ms") / 1000 / USED),
    )
    simulators = math.ceil(trial_cores / CORES_PER_SIMULATOR / USED)
    api = max(1, math.ceil(per_s("api cpu_ms") / 1000 / USED))
    return Need(
        turns_s=turns_s,
        jobs_day=jobs_s * DAY_S,
        construct=construct,
        simulators=simulators,
        api=api,
        postgres_connections=connections(
            api=api, construct=construct, trials=simulators * CORES_PER_SIMULATOR
        ),
        postgres_cores=per_s("postgres cpu_ms") / 1000,
        postgres_log_mb_s=per_s("postgres log bytes") / 1e6,
        postgres_gb_day=turns_s * turn["postgres stored bytes"] * DAY_S / 1e9,
        valkey_share=per_s("valkey commands") / COMMANDS_PER_VALKEY,
        artifacts_gb_day=turns_s * turn["artifact bytes"] * DAY_S / 1e9,
    )


LOADS: Final = (
    Load(sessions=10),
    Load(sessions=1_000),
    Load(sessions=100_000),
    Load(sessions=100_000, lease_s=60.0),
)


def table(costs: dict[str, Any]) -> str:
    """The sizing table in Markdown."""
    rows: list[tuple[str, list[str]]] = [
        ("lease, `BUILDARENA_LEASE_S`", [f"{load.lease_s:.0f} s" for load in LOADS])
    ]
    needs = [need(load, costs) for load in LOADS]
    rows += [
        ("model requests a second", [f"{one.turns_s:,.1f}" for one in needs]),
        ("jobs a day", [f"{one.jobs_day:,.0f}" for one in needs]),
        ("construct processes", [f"{one.construct:,}" for one in needs]),
        ("simulation workers (2 at once)", [f"{one.simulators:,}" for one in needs]),
        ("API processes", [f"{one.api:,}" for one in needs]),
        ("Postgres, connections at most", [f"{one.postgres_connections:,}" for one in needs]),
        ("Postgres, cores used", [f"{one.postgres_cores:,.2f}" for one in needs]),
        ("Postgres, log MB/s", [f"{one.postgres_log_mb_s:,.2f}" for one in needs]),
        ("Postgres, growth GB/day", [f"{one.postgres_gb_day:,.2f}" for one in needs]),
        ("Valkey, share of one", [f"{one.valkey_share:.1%}" for one in needs]),
        ("artifacts, GB/day", [f"{one.artifacts_gb_day:,.2f}" for one in needs]),
        ("beyond one server", [", ".join(one.limits) or "nothing" for one in needs]),
    ]
    head = [f"{load.sessions:,} sessions" for load in LOADS]
    lines = ["| | " + " | ".join(head) + " |", "|---|" + "---|" * len(head)]
    return "\n".join([*lines, *(f"| {name} | {' | '.join(row)} |" for name, row in rows)])


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--costs", type=Path, default=COSTS, help="what bench-costs wrote")
    given = parser.parse_args()
    sys.stdout.write(table(json.loads(given.costs.read_text())) + "\n")


if __name__ == "__main__":
    main()
