"""Honest machines of the shapes that people build get the verdict that they deserve."""

import pytest
from support.machines.people.designs import HONEST, kept, verdict

from buildarena_benchmark.scorers.registry import known_flags
from buildarena_simulation import ENGINES

pytestmark = pytest.mark.nightly

HANDFUL = ["arch over 5", "car of 5 wheels", "ring of 3 cannons", "canard"]
"""One of several categories each; `make test-nightly` tries all."""


def _disqualifying(flags: list[str]) -> list[str]:
    return [flag for flag in flags if known_flags()[flag].disqualifying]


def _require_kept(name: str, engine: str) -> None:
    told, now = kept()[name][engine], verdict(name, engine)
    assert now["success"] == told["success"], now
    assert _disqualifying(now["flags"]) == _disqualifying(told["flags"])


@pytest.mark.parametrize("name", HANDFUL)
def test_a_handful_of_honest_machines_keep_their_verdict(engine, name) -> None:
    _require_kept(name, engine)


@pytest.mark.parametrize("name", [name for name in HONEST if name not in HANDFUL])
def test_honest_machines_keep_their_verdict(engine, name) -> None:
    _require_kept(name, engine)


def test_there_are_sixty_and_the_file_has_each() -> None:
    assert len(HONEST) >= 60
    assert {name: row["task"] for name, row in kept().items()} == {
        name: design.task for name, design in HONEST.items()
    }


@pytest.mark.parametrize("engine_name", ENGINES)
def test_what_is_built_to_succeed_succeeds_and_nothing_disqualifies_it(engine_name) -> None:
    failed = {
        name: row[engine_name]
        for name, row in kept().items()
        if not row[engine_name]["success"] or _disqualifying(row[engine_name]["flags"])
    }
    assert not failed
