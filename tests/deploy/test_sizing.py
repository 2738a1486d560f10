"""The sizing model: more costs more, and the document says what the model says."""

import json
import re
from dataclasses import replace
from pathlib import Path

from benchmarks.sizing.sizing_model import (
    CORES_PER_SIMULATOR,
    COSTS,
    LOADS,
    Load,
    connections,
    need,
    table,
)

ROOT = Path(__file__).parents[2]

MEASURED = json.loads(COSTS.read_text())


def test_the_document_has_the_models_table() -> None:
    assert table(MEASURED) in (ROOT / "docs/scaling.md").read_text()


def test_ten_times_the_sessions_need_ten_times_as_much() -> None:
    one, ten = (need(Load(sessions=n), MEASURED) for n in (1_000, 10_000))
    for name in ("turns_s", "jobs_day", "postgres_cores", "postgres_log_mb_s", "valkey_share"):
        assert abs(getattr(ten, name) / getattr(one, name) - 10) < 1e-9, name


def test_a_longer_lease_costs_postgres_less_and_changes_no_turn() -> None:
    short = need(LOADS[2], MEASURED)
    long = need(replace(LOADS[2], lease_s=60.0), MEASURED)
    assert long.turns_s == short.turns_s
    assert long.postgres_log_mb_s < short.postgres_log_mb_s / 2
    assert "Postgres' log" in short.limits
    assert long.limits == ["Postgres' connections: a pooler"]


def test_slower_models_need_fewer_simulators_for_as_many_sessions() -> None:
    fast, slow = (need(Load(sessions=10_000, reply_s=reply_s), MEASURED) for reply_s in (5.0, 50.0))
    assert fast.simulators > 5 * slow.simulators
    assert fast.construct >= slow.construct


def test_composes_postgres_takes_all_connections_that_its_hints_can_open() -> None:
    compose = (ROOT / "docker-compose.yml").read_text()
    (most,) = map(int, re.findall(r"max_connections=(\d+)", compose))
    hints = [*compose.splitlines(), *(ROOT / "docs/deploying.md").read_text().splitlines()]
    scales = [dict(re.findall(r"--scale ([a-z-]+)=(\d+)", hint)) for hint in hints]
    assert any(scales)
    for scale in scales:
        asked = {"api": 1, "construct": 1, "simulate-mujoco": 1, "simulate-pybullet": 1}
        asked |= {name: int(number) for name, number in scale.items()}
        simulators = asked["simulate-mujoco"] + asked["simulate-pybullet"]
        opened = connections(
            api=asked["api"],
            construct=asked["construct"],
            trials=simulators * CORES_PER_SIMULATOR,
        )
        # Postgres keeps three for its superuser; commands, backups and checks take a few.
        assert opened <= most - 3 - 20, scale
