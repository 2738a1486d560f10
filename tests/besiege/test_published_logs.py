"""Logs of the published runner become trajectories that our scorers take."""

import numpy as np
import pytest
from tests.besiege.playing import vehicle
from tests.besiege.published_logs import cleaned, copies, printed

from buildarena_benchmark import builtin_tasks, score
from buildarena_besiege import LogIncompleteError, looks_published, published_trajectory

TASKS = builtin_tasks()
MACHINE = vehicle(cannon=True)
SUPPORT = TASKS["support-2"]
DRIVE = TASKS["transport-1"]


def fall(_name: str, n: int) -> tuple[float, float, float]:
    return (0.0, 8.0 - max(n - 1000, 0) * 0.01, 1.0)


def mass(n: int) -> dict[str, str]:
    return {"Ballast": f"{SUPPORT.scenario.cargo.mass_at(n / 100):.1f}"}


def drive(name: str, n: int) -> tuple[float, float, float]:
    return (float(name), 1.0, n * 0.004)


SUPPORT_ROWS = printed(fall, names=["Ballast"], last=1700, state=mass)
DRIVE_ROWS = printed(drive, names=["1", "2", "3"], last=3000)
FORMS = {
    "cleaned": cleaned(SUPPORT_ROWS),
    "raw": copies(SUPPORT_ROWS, window=300, every=50),
    "windows": copies(SUPPORT_ROWS).replace("\n", "\r\n"),
    "quoted": "\n".join(",".join(f'"{p.strip()}"' for p in r.split(",")) for r in SUPPORT_ROWS),
    "byte order mark": "\ufeff" + cleaned(SUPPORT_ROWS),
    "empty rows": cleaned(SUPPORT_ROWS).replace("\n", "\n\n,,\n"),
}


def read(text, task=SUPPORT):
    return published_trajectory(text, MACHINE, task.scenario)


@pytest.mark.parametrize("form", FORMS)
def test_a_bridges_load_is_scored_from_any_form(form) -> None:
    found = read(FORMS[form])
    result = score(SUPPORT, MACHINE, found)
    # The height is below 4 from 14.04 s on; one decimal costs a tenth of a second.
    wanted = SUPPORT.scenario.cargo.mass_at(14.04)
    assert result.indicator == pytest.approx(wanted, abs=15.0)
    assert found.time_s[-1] == 17.0
    assert np.abs(found.cargo_position[:250, 2] - 8.0).max() < 0.05
    assert (found.engine, found.engine_version, found.bearing) == ("besiege", "published", None)


def test_a_vehicles_path_is_scored() -> None:
    found = read(copies(DRIVE_ROWS), DRIVE)
    assert found.block_ids == ("1", "2", "3")
    assert found.positions[500, 0] == pytest.approx([1.0, 8.0, 1.0], abs=0.1)
    assert (found.pieces == 0).all()
    assert score(DRIVE, MACHINE, found).metrics["driven"] is False
    assert looks_published(copies(DRIVE_ROWS))


def test_cannons_burn_as_the_log_says() -> None:
    rows = printed(drive, names=["4", "5"], last=1000, state=lambda n: {"5": str(n >= 500).lower()})
    found = read(cleaned(rows), TASKS["lift-1"])
    assert found.pieces is None, "no starting block is told of"
    heated = found.heated[:, 0]
    assert not heated[:124].any()
    assert heated[127:].all()


TRAPS = {
    "a cut position that looks like a mass": "8.4, ID_Ballast, 0.0",
    "a number cut at its point": "8.4, ID_Ballast, 0.0, 9.",
    "a number cut before its point": "8.4, ID_Ballast, 0.0, 9, 1",
    "a number without its last digits": "8.4, ID_Ballast, 0.0, 99.9, 1",
    "a lone minus": "8.4, ID_Ballast, 0.0, 9.9, -",
    "a fourth field": "8.4, ID_Ballast, 0.0, 99.9",
    "no time": "x, ID_Ballast, 0.0, 99.9, 1.0",
    "no name": "8.4, Ballast, 0.0, 99.9, 1.0",
    "not numbers": "8.4, ID_Ballast, nan, inf, 1e5",
    "other digits": "8.4, ID_Ballast, \u0660.\u0660, \u0669.\u0669, \u0660.\u0660",
    "an error without commas": "main.lua:3: attempt to index nil",
    "an error with commas": "main.lua:3: bad argument #1, number expected, got nil, x, y",
    "an unknown block": "8.4, ID_99, 1.0, 2.0, 3.0",
}


@pytest.mark.parametrize("trap", TRAPS)
def test_rows_that_are_not_whole_do_not_count(trap) -> None:
    rows = list(SUPPORT_ROWS)
    rows.insert(400, TRAPS[trap])
    plain, trapped = read("\n".join(SUPPORT_ROWS)), read("\n".join(rows))
    assert (plain.cargo_position == trapped.cargo_position).all()
    assert (plain.cargo_mass == trapped.cargo_mass).all()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "tells nothing of the cargo"),
        ("main.lua:1: x", "speaks of an error"),
        ("\n".join(SUPPORT_ROWS[:-400]), "ends at 9 s of 17 s"),
        ("\n".join(SUPPORT_ROWS[:200] + SUPPORT_ROWS[260:]), "nothing is told of the cargo"),
        ("\n".join(row for row in SUPPORT_ROWS if row.count(",") == 4), "cargo's mass"),
        ("\n".join(row.replace(", 8.0, 1.0", ", 8.0, 2.0") for row in DRIVE_ROWS), "the cargo"),
    ],
)
def test_what_is_missing_is_said(text, says) -> None:
    with pytest.raises(LogIncompleteError, match=says):
        read(text)


def test_a_log_may_end_a_little_early() -> None:
    rows = [row for row in SUPPORT_ROWS if float(row.split(",")[0]) <= 16.3]
    found = read("\n".join(rows))
    assert (found.time_s[-1], found.settings["ends_at_s"]) == (16.28, 16.3)


def test_a_log_of_several_runs_is_refused() -> None:
    runs = [
        printed(lambda _, n, k=k: (k, 1.0, n * 0.01), names=["1", "2"], last=3000) for k in range(3)
    ]
    with pytest.raises(LogIncompleteError, match=r"several runs|different positions of block"):
        read("\n".join(row for rows in runs for row in rows), DRIVE)


def test_a_log_of_nobody_is_refused() -> None:
    rows = printed(lambda *_: (0.0, 0.0, 0.0), names=["77"], last=3000)
    with pytest.raises(LogIncompleteError, match="nothing of any block"):
        read("\n".join(rows), DRIVE)
    assert not looks_published("hello, world\n1,2,3,4,5")
