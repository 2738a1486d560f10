"""Packages of a challenge: what is sound passes, and each thing that is not has its sentence."""

import json
import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from support.challenge import (
    CENTER,
    MACHINES,
    braced_files,
    bridge_files,
    flight_text,
    package_files,
    zipped,
)
from support.machines.families import car as family_car
from support.machines.piloted import experts_machine

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.scorers.measures.orbits import swept
from buildarena_geometry.machine_files import machine_of
from buildarena_pipeline.challenges.checking import Report, check_package
from buildarena_pipeline.challenges.judging import fingerprints, judge_folder
from buildarena_pipeline.challenges.package import (
    Package,
    PackageError,
    packed_package,
    read_package,
)
from buildarena_pipeline.challenges.season import SeasonError, read_season, season_named

S01 = season_named("s01-stable-orbit")
KNOWN = S01.with_parameters({"center": list(CENTER), "omega_ref": 0.3})
Files = dict[str, bytes]


def checked(files: Files, season=S01, track: str = "autopilot") -> Report:
    return check_package(Package(files), season, track)


def failures(files: Files) -> dict[str, str]:
    return {each.check: each.sentence for each in checked(files).findings if not each.passed}


def in_file(name: str, old: str, new: str, count: int = 1) -> Callable[[Files], None]:
    def change(files: Files) -> None:
        text = files[name].decode()
        assert old in text, old
        files[name] = text.replace(old, new, count).encode()

    return change


def in_flight(edit: Callable[[list[str]], list[str]]) -> Callable[[Files], None]:
    """Changes the lines of the tracker's file; the header is the fifth, samples follow."""

    def change(files: Files) -> None:
        lines = edit(files["trajectory.csv"].decode().splitlines())
        files["trajectory.csv"] = ("\n".join(lines) + "\n").encode()

    return change


def with_cell(row: int, column: int, value: str) -> Callable[[Files], None]:
    def edit(lines: list[str]) -> list[str]:
        cells = lines[5 + row].split(",")
        cells[column] = value
        lines[5 + row] = ",".join(cells)
        return lines

    return in_flight(edit)


def jumping(lines: list[str]) -> list[str]:
    for k in range(300, len(lines)):
        cells = lines[k].split(",")
        cells[16] = str(float(cells[16]) + 200.0)
        lines[k] = ",".join(cells)
    return lines


def cut_off(files: Files) -> None:
    files["trajectory.csv"] = files["trajectory.csv"][:-3]


def without_action(files: Files) -> None:
    full = json.loads(files["build_history_full.json"])
    files["build_history_full.json"] = json.dumps(full[:4] + full[5:]).encode()


def in_other_order(files: Files) -> None:
    full = json.loads(files["build_history_full.json"])
    full[4], full[5] = full[5], full[4]
    files["build_history_full.json"] = json.dumps(full).encode()


def without_last_block(files: Files) -> None:
    text = files["machine_tuned.bsg"].decode()
    at = text.rindex("  <Block id")
    files["machine_tuned.bsg"] = (text[:at] + text[text.index("\n", at) + 1 :]).encode()


TUNED, RAW, FLIGHT = "machine_tuned.bsg", "machine_raw.bsg", "trajectory.csv"
SECOND, THIRD = "11c29d83-9fad-49dc-8f25-a6245790938d", "e6fec973-29d0-4b75-82a3-381a4ab6dd4d"
WRONG: dict[str, tuple[Callable[[Files], None], str, str]] = {
    "a moved block": (in_file(TUNED, 'x="0.5"', 'x="0.5002"'), "tuned", "0.0002 units away"),
    "a block moved in the raw file": (in_file(RAW, 'x="0.5"', 'x="0.52"'), "history", "units away"),
    "a turned block": (in_file(TUNED, 'y="0.7071068"', 'y="0.71"'), "tuned", "is turned by"),
    "a changed scale": (in_file(TUNED, 'Scale x="1"', 'Scale x="1.1"'), "tuned", "scale"),
    "a resized raw block": (in_file(RAW, 'Scale x="1.0"', 'Scale x="2"'), "history", "resized"),
    "another guid": (in_file(TUNED, SECOND, "2" + SECOND[1:]), "tuned", "no block with the guid"),
    "another type": (in_file(TUNED, 'id="91"', 'id="90"'), "tuned", "by its guid"),
    "a block less": (without_last_block, "tuned", "1 Steering Thruster fewer"),
    "a script": (
        in_file(TUNED, " <Data>\n", ' <Data><Boolean key="lua">True</Boolean>\n'),
        "programs",
        "lua",
    ),
    "another mod": (in_file(TUNED, "1d45bae7", "00000000"), "programs", "needs the mod"),
    "a tracker of another block": (
        in_file(FLIGHT, "78a5b761", "11c29d83", 10**6),
        "target",
        "the starting block is 78a5b761",
    ),
    "a jump": (in_flight(jumping), "jumps", "is a jump"),
    "a flight that was cut off": (cut_off, "samples", "cut off"),
    "a row that was cut off": (
        in_flight(lambda lines: [*lines[:-1], lines[-1][:40]]),
        "samples",
        "cut off or changed",
    ),
    "a beginning that is missing": (
        in_flight(lambda lines: lines[:5] + lines[25:]),
        "samples",
        "its beginning is missing",
    ),
    "a hole": (in_flight(lambda lines: lines[:50] + lines[60:]), "samples", "does not follow"),
    "a machine that heals": (with_cell(3, 9, "0.5"), "samples", "more whole than before"),
    "a share above one": (with_cell(3, 9, "1.5"), "samples", "a share"),
    "a number that is none": (with_cell(7, 17, "NaN"), "samples", "no number within"),
    "a huge number": (with_cell(7, 17, "1e308"), "samples", "no number within"),
    "time that stands still": (with_cell(8, 4, "0.7"), "samples", "time does not pass"),
    "more blocks at the start": (with_cell(0, 12, "9"), "target", "not 3"),
    "a history without an action": (without_action, "full-history", "action 2"),
    "a history in another order": (in_other_order, "full-history", "after those before it"),
    "an action that is refused": (
        in_file("build_history.json", '"f1"', '"f0"'),
        "history",
        "action 3",
    ),
    "a history that is no list": (
        lambda files: files.update({"build_history.json": b"{}"}),
        "history",
        "expected a list of actions",
    ),
    "a transcript that is missing": (
        lambda files: files.pop("chat_transcript.md") and None,
        "transcript",
        "is missing",
    ),
    "a transcript of nothing": (
        lambda files: files.update({"chat_transcript.md": b"none"}),
        "transcript",
        "4 characters",
    ),
    "a seventh file": (lambda files: files.update({"a.txt": b""}), "files", "a.txt is none"),
}


@pytest.mark.parametrize("machine", MACHINES)
def test_the_public_histories_build_the_games_files(machine: str) -> None:
    report = checked(package_files(machine))
    assert report.passed, [each for each in report.findings if not each.passed]
    assert {WRONG[what][1] for what in WRONG} <= {each.check for each in report.findings}


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_fails_with_one_sentence(what: str) -> None:
    change, check, words = WRONG[what]
    files = package_files("three_blocks")
    change(files)
    failed = failures(files)
    assert check in failed, failed
    assert words in failed[check]
    assert "\n" not in failed[check]


def test_swapped_guids_are_moved_blocks() -> None:
    files = package_files("three_blocks")
    text = files[TUNED].decode().replace(SECOND, "@").replace(THIRD, SECOND).replace("@", THIRD)
    files[TUNED] = text.encode()
    assert "1 units away" in failures(files)["tuned"]


def test_a_removed_connection_fails() -> None:
    assert checked(braced_files()).passed
    files = braced_files()
    text = files[TUNED].decode()
    end = re.search(r'<Vector3 key="end-position">.*?</Vector3>', text, re.DOTALL)
    assert end is not None
    files[TUNED] = text.replace(end[0], "").encode()
    assert "its connection was removed" in failures(files)["tuned"]
    moved = re.sub(r"<X>[^<]*</X>", "<X>0.3</X>", end[0])
    files[TUNED] = text.replace(end[0], moved).encode()
    assert "end-position at (0.3" in failures(files)["tuned"]
    files[RAW] = files[TUNED]
    assert "end-position at (0.3" in failures(files)["history"]


def test_settings_and_keys_may_differ() -> None:
    files = package_files("three_blocks")
    in_file(TUNED, "<String>M3</String>", "<String>P</String>", 2)(files)
    in_file(TUNED, '"bmt-fthrust">3', '"bmt-fthrust">1.5', 2)(files)
    assert not failures(files)


def test_a_track_of_humans_needs_no_transcript() -> None:
    files = package_files("three_blocks")
    del files["chat_transcript.md"]
    assert checked(files, track="human").passed
    with pytest.raises(SeasonError, match="there is autopilot, copilot, human"):
        checked(files, track="Human")


FLIGHTS = {
    # cycles, share of whole, expected points of progress and of integrity
    "three cycles and more": (3.2, 1.0, 70.0, 10.0),
    "exactly a half": (1.5, 1.0, 35.0, 10.0),
    "one cycle": (1.0, 0.5, 70.0 / 3, 5.0),
    "a tenth": (0.1, 0.25, 70.0 / 30, 2.5),
    "many": (12.0, 0.0, 70.0, 0.0),
}


@pytest.mark.parametrize("flight", FLIGHTS)
def test_a_score_is_what_a_hand_calculates(flight: str) -> None:
    cycles, whole, progress, integrity = FLIGHTS[flight]
    files = package_files("three_blocks")
    guid = "78a5b761-49c0-49b0-ba39-0c23a1ea12f7"
    files[FLIGHT] = flight_text(guid, blocks=3, cycles=cycles, integrity=whole).encode()
    score = checked(files, KNOWN).score
    assert score is not None
    points = [term.points * term.share for term in score.terms]
    lasted = files[FLIGHT].count(b"StartingBlock") * 0.1 - 0.1
    omega = 2 * math.pi * cycles / lasted
    assert points[0] == pytest.approx(progress, rel=5e-3)
    assert points[1] == pytest.approx(20.0 * omega / 0.3, rel=2e-2)
    assert points[2] == pytest.approx(integrity)
    assert score.performance == pytest.approx(sum(points))
    assert score.final is None
    assert score.unknown == ("cost_penalty", "coefficient.autopilot")


def test_what_is_not_known_is_said_and_not_guessed() -> None:
    nowhere = S01.with_parameters({"center": None})
    score = checked(package_files("five_blocks"), nowhere).score
    assert score is not None
    assert (score.performance, score.known, score.at_most) == (None, 10.0, 100.0)
    assert score.unknown[:2] == ("center", "omega_ref")
    whole = KNOWN.with_parameters({"cost_penalty": 0.5, "coefficient.autopilot": 1.2})
    final = checked(package_files("five_blocks"), whole).score
    assert final is not None
    assert final.final == pytest.approx(final.performance * 1.2 - 0.5 * final.cost)


def test_swinging_to_and_fro_goes_round_nothing() -> None:
    times = np.linspace(0.0, 60.0, 4001)
    swings = math.pi / 2 * np.sin(times)
    path = 500.0 * np.column_stack([np.cos(swings), np.sin(swings), np.zeros(len(times))])
    assert abs(swept(path, np.zeros(3))[-1]) < math.pi
    beside = path + np.array([2000.0, 0.0, 0.0])
    assert abs(swept(beside, np.zeros(3))[-1]) < 0.6
    tilted = 500.0 * np.column_stack([np.cos(times), 0.6 * np.sin(times), 0.8 * np.sin(times)])
    assert abs(swept(tilted, np.zeros(3))[-1]) == pytest.approx(60.0, rel=1e-6)


def test_folders_and_zip_files_are_packages(tmp_path: Path) -> None:
    files = package_files("three_blocks")
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    assert read_package(tmp_path).files == files
    assert packed_package(zipped(files)).files == files
    assert packed_package(zipped(files, folder="ENTRY/")).files == files


def test_hostile_packages_are_refused(tmp_path: Path) -> None:
    bomb = zipped({"trajectory.csv": b"0" * (15 << 20)})
    with pytest.raises(PackageError, match="times as large as it is packed"):
        packed_package(bomb)
    with pytest.raises(PackageError, match="at most"):
        packed_package(zipped({"trajectory.csv": b"0" * (17 << 20)}))
    with pytest.raises(PackageError, match="no sound ZIP"):
        packed_package(b"PK\x03\x04 and no more")
    (tmp_path / "trajectory.csv").symlink_to("/etc/passwd")
    with pytest.raises(PackageError, match="no ordinary file"):
        read_package(tmp_path)
    with pytest.raises(PackageError, match="No such file"):
        read_package(tmp_path / "nothing")
    large = tmp_path / "large.zip"
    with large.open("wb") as file:
        file.truncate(10 << 30)
    with pytest.raises(PackageError, match="most that is read"):
        read_package(large)


def test_other_encodings_have_a_sentence() -> None:
    for name in package_files("three_blocks"):
        files = package_files("three_blocks")
        files[name] = b"\xff\xfe" + "é\n".encode("utf-16-le") * 200
        assert failures(files)


def test_organisers_see_ranks_refusals_and_copies(tmp_path: Path) -> None:
    (tmp_path / "first.zip").write_bytes(zipped(package_files("three_blocks")))
    (tmp_path / "other.zip").write_bytes(zipped(package_files("five_blocks")))
    copied = package_files("three_blocks")
    history = json.loads(copied["build_history.json"])
    history[1]["params"]["note"] = "all my own"
    copied["build_history.json"] = json.dumps(history).encode()
    (tmp_path / "copied.zip").write_bytes(zipped(copied))
    (tmp_path / "broken.zip").write_bytes(b"PK")
    entries = {entry.name: entry for entry in judge_folder(tmp_path, KNOWN, "autopilot")}
    assert entries["first.zip"].copies == ("copied.zip",)
    assert entries["other.zip"].copies == ()
    assert entries["first.zip"].rank == entries["other.zip"].rank == 1
    assert "action 2" in entries["copied.zip"].refused
    assert "no sound ZIP" in entries["broken.zip"].refused


BRIDGES = season_named("first-bridges")


@pytest.mark.nightly
def test_bridges_are_tried_and_scored() -> None:
    report = checked(bridge_files(), BRIDGES, "agent")
    assert report.passed, report.findings
    assert report.score is not None
    shares = [term.share for term in report.score.terms]
    assert all(0.6 < share < 1.0 for share in shares)
    assert report.score.final == pytest.approx(100 * sum(shares) / 3)
    assert report.score.unknown == ()


@pytest.mark.ci
def test_flights_are_flown_and_scored() -> None:
    files = {
        f"{name}.json": json.dumps(experts_machine(builtin_tasks()[name]).to_document()).encode()
        for name in ("orbit-1", "orbit-2")
    }
    report = checked(files, season_named("first-orbits"), "human")
    assert report.passed, report.findings
    assert report.score is not None
    assert all(0.6 < term.share < 1.0 for term in report.score.terms)


@pytest.mark.ci
def test_what_is_no_bridge_bears_nothing() -> None:
    car = json.dumps(family_car().to_document()).encode()
    score = checked({**bridge_files(), "support-2.json": car}, BRIDGES, "agent").score
    assert score is not None
    assert score.terms[1].share == 0
    assert "the trial failed" in score.terms[1].sentence


def test_bridges_that_break_rules_have_sentences() -> None:
    refused = [{"op": "start", "params": {}}, {"op": "fly", "params": {}}]
    for content, check, words in (
        (b"{}", "machines", "neither a machine document nor an action log"),
        (b"\xff", "machines", "support-2.json"),
        (json.dumps(refused).encode(), "machines", "action 2, fly, is refused"),
    ):
        report = checked({**bridge_files(), "support-2.json": content}, BRIDGES, "agent")
        failed = {each.check: each.sentence for each in report.findings if not each.passed}
        assert words in failed[check]
        assert report.score is None
    no_powered = BRIDGES.model_copy(update={"modules": ("Brace",)})
    report = checked(bridge_files(), no_powered, "agent")
    assert "is no module of the season" in next(
        each.sentence for each in report.findings if each.check == "modules"
    )


def test_bridges_of_another_are_copies() -> None:
    own = fingerprints(Package(bridge_files()), BRIDGES)
    assert len(own) == 3
    documents = {
        name: json.dumps(machine_of(json.loads(content), where=name).to_document()).encode()
        for name, content in bridge_files().items()
        if name.endswith(".json")
    }
    assert fingerprints(Package(documents), BRIDGES) == own
    moved = json.loads(bridge_files()["support-1.json"])[:-1]
    other = {**documents, "support-1.json": json.dumps(moved).encode()}
    assert len(fingerprints(Package(other), BRIDGES) & own) >= 2
    assert fingerprints(Package({"support-1.json": b"nothing"}), BRIDGES) == frozenset()


def test_a_wrong_season_is_told_where(tmp_path: Path) -> None:
    text = S01.model_dump_json()
    assert read_season(text.encode(), where="own.yaml") == S01
    for old, new, words in (
        ('"progress":0.7', '"progress":0.8', "the weights sum to 1.1"),
        ('"formula":"orbit"', '"formula":"line"', "formula"),
        ('"modules":"all"', '"modules":["Wing Panel","Wong"]', "no module 'Wong'"),
        ('"raw":"machine_raw.bsg"', '"raw":"trajectory.csv"', "two files are called"),
        ('"cycles":3.0', '"cycles":0', "cycles"),
    ):
        assert old in text
        with pytest.raises(SeasonError, match=r"own\.yaml") as refusal:
            read_season(text.replace(old, new).encode(), where="own.yaml")
        assert words in str(refusal.value)
    with pytest.raises(SeasonError, match="is no parameter of"):
        S01.with_parameters({"formula": 1})
    with pytest.raises(SeasonError, match="there is first-bridges, first-orbits, s01-stable-orbit"):
        season_named("s02")
    with pytest.raises(SeasonError, match="No such file"):
        season_named(str(tmp_path / "own.yaml"))
