"""What each step of a first evening says of a game that is as assumed, and of one that is not."""

import re

import pytest
from support.evenings import (
    MEASURED,
    engine_record,
    evening,
    inputs_of,
    machine_file,
    packed,
    step_inputs,
)
from support.machines.evidence import FILE
from support.machines.evidence import packed as packed_machines

from buildarena_pipeline.evidence import (
    ASSUMPTIONS,
    STEPS,
    EvidenceError,
    StepRecord,
    Verdict,
    judged,
    page,
    step_named,
    table_of,
    write_evidence,
)
from buildarena_pipeline.evidence.document import Point, RunRecord
from buildarena_pipeline.evidence.packing import without_paths

SHOWN = tuple(name for name in STEPS if name != "calibration" and not name.startswith("expert"))
CONFIRMED, CONTRADICTED, NOT_SEEN = Verdict
WHEEL = 18
"""Which sense is the speed of the first wheel that the program turns."""


def verdicts(inputs) -> dict[str, Verdict]:
    return {entry.assumption: entry.verdict for entry in judged(inputs).judgements}


def seen(inputs, assumption: str) -> str:
    return next(e.seen for e in judged(inputs).judgements if e.assumption == assumption)


def moved(line: str, axis: int, change) -> str:
    """A sample line with a coordinate of every block changed; 0 east, 1 up, 2 north."""
    fields = line.split(",")
    if fields[0] == "s":
        for at in range(6 + axis, len(fields), 5):
            fields[at] = f"{change(float(fields[at])):.4f}"
    return ",".join(fields)


def told(line: str, sense: int, value: float) -> str:
    """A line of what a program was told with one of its senses changed."""
    fields = line.split(",")
    if fields[0] == "p" and fields[2] == "1":
        fields[4 + sense] = f"{value:.6f}"
    return ",".join(fields)


@pytest.mark.parametrize("name", [*SHOWN, "expert-support-1"])
def test_a_game_that_is_as_assumed_confirms_all_that_can_be_seen(name) -> None:
    expected = dict.fromkeys(STEPS[name].assumes, CONFIRMED)
    if "mass_slider" in expected:
        expected["mass_slider"] = NOT_SEEN
    assert verdicts(step_inputs(name)) == expected


def test_every_assumption_is_some_steps_and_every_steps_is_known() -> None:
    assumed = {name for step in STEPS.values() for name in step.assumes}
    assert assumed == set(ASSUMPTIONS)


@pytest.mark.parametrize(
    ("name", "assumption", "spoiled"),
    [
        ("probe", "gravity", {"gravity": 9.81}),
        ("probe", "floor", {"ground": lambda _: 1.0}),
        ("probe", "pace", {"measured": MEASURED.model_copy(update={"pace": 0.5})}),
        ("probe", "copies", {"measured": MEASURED.model_copy(update={"longest_pause_s": 9.0})}),
        ("drop", "colliders", {"spoil": lambda line: moved(line, 1, lambda y: y + 0.3)}),
        ("drop", "landing", {"spoil": lambda line: moved(line, 1, lambda y: y + 0.3)}),
        ("scales", "masses", {"spoil": lambda line: moved(line, 1, lambda y: 15 - y)}),
        ("wheels", "wheels", {"spoil": lambda line: moved(line, 2, lambda z: z * 0.5)}),
        ("program", "program_senses", {"spoil": lambda line: told(line, 2, 1.0)}),
        ("program", "program_senses", {"spoil": lambda line: told(line, 8, -1.0)}),
        ("program", "program_keys", {"spoil": lambda line: told(line, WHEEL, 0.0)}),
        ("program", "program_shares", {"spoil": lambda line: told(line, WHEEL + 2, 9.0)}),
        ("expert-support-1", "level_origin", {"ground": lambda height: height * 0.9}),
    ],
)
def test_a_game_that_is_otherwise_contradicts_it(name, assumption, spoiled) -> None:
    assert verdicts(step_inputs(name, **spoiled))[assumption] is CONTRADICTED


def test_a_program_that_answers_otherwise_or_fails_in_the_game_does_not_run_as_ours() -> None:
    half = step_inputs("program", spoil=lambda line: line.replace(",0.500000", ",0.600000"))
    assert "answered otherwise in the game" in seen(half, "program_text")
    assert set(verdicts(half).values()) == {NOT_SEEN}


def test_places_of_centres_are_no_roots() -> None:
    def centred(line: str) -> str:
        fields = line.split(",")
        if fields[0] == "s":  # the second block, half a block further east
            fields[11] = f"{float(fields[11]) + 0.5:.4f}"
        return ",".join(fields)

    inputs = step_inputs("probe", spoil=centred)
    assert verdicts(inputs)["roots"] is CONTRADICTED
    assert seen(inputs, "roots") == "Small Wooden Block 0.50 away"


@pytest.mark.parametrize(
    ("change", "assumption", "sentence"),
    [
        (("bmt-extend", "bmt-pull"), "entries", "Piston: bmt-extend is gone"),
        (("Alpha2", "Alpha9"), "entries", "Alpha2 became Alpha9"),
        (('h">4.0', 'h">5.0'), "entries", "Water Cannon: bmt-strength 4.0 became 5.0"),
        (("StringArray", "Strings"), "entries", "became a Strings"),
        (('id="5"', 'id="15"'), "modules", "Hinge: 0 of 1"),
        (("</Machine>", ""), "modules", "cannot be read"),
    ],
)
def test_what_the_game_saves_otherwise_is_named_by_its_type(change, assumption, sentence) -> None:
    inputs = step_inputs("sampler", saved=lambda data: data.replace(*map(str.encode, change)))
    assert verdicts(inputs)[assumption] is CONTRADICTED
    assert sentence in seen(inputs, assumption)


def test_entries_of_the_games_own_contradict_nothing() -> None:
    assert seen(step_inputs("sampler"), "entries").endswith("the game's own: bmt-burnt")


def test_another_verdict_of_an_engine_is_no_agreement() -> None:
    ours = engine_record("support-1")
    failing = ours.model_copy(update={"figures": {"success": 0.0, "indicator": 3.0}})
    inputs = step_inputs("expert-support-1", engines={"mujoco": ours, "pybullet": failing})
    assert verdicts(inputs)["agreement"] is CONTRADICTED
    table = table_of(evening([inputs])[0])
    rows = {(row.task, row.engine): (row.same_verdict, row.trials) for row in table.agreement}
    assert rows["all", "mujoco"] == (1, 1)
    assert rows["support-1", "pybullet"] == (0, 1)
    assert table.agreement[0].low == pytest.approx(0.025)


def test_without_engines_nothing_is_said_of_them() -> None:
    assert verdicts(step_inputs("wheels", engines={})) == {"wheels": NOT_SEEN}


def test_a_point_that_is_wrong_contradicts_what_is_installed() -> None:
    points = (Point(name="Lua Scripting Mod", ok=False, detail="no Mod.xml"),)
    inputs = inputs_of(StepRecord(name="doctor", state="done", points=points), {})
    assert verdicts(inputs) == {"versions": CONTRADICTED}
    assert seen(inputs, "versions") == "Lua Scripting Mod: no Mod.xml"


def test_a_calibration_is_confirmed_by_a_whole_log_only() -> None:
    runs = (RunRecord(number=1, run_id="run1", measured=MEASURED),)
    record = StepRecord(name="calibration", state="done", runs=runs)
    log = step_inputs("probe").files["log-1.txt"]
    assert verdicts(inputs_of(record, {"log-1.txt": log})) == {"places": CONFIRMED}
    half = log[: len(log) // 2]
    assert verdicts(inputs_of(record, {"log-1.txt": half})) == {"places": CONTRADICTED}


def test_a_log_that_tells_too_little_is_not_seen_and_says_why() -> None:
    whole = step_inputs("drop")
    cut = {**whole.files, "log-1.txt": whole.files["log-1.txt"][:3000]}
    inputs = inputs_of(whole.record, cut)
    assert verdicts(inputs) == {"colliders": NOT_SEEN, "landing": NOT_SEEN}
    assert "end" in seen(inputs, "landing")


def test_a_step_that_failed_says_so_of_all_that_it_is_about() -> None:
    record = StepRecord(name="drop", state="failed", detail="a dialog is in the way")
    assert {e.seen for e in judged(inputs_of(record, {})).judgements} == {"a dialog is in the way"}


def test_verdicts_are_found_and_never_taken_over() -> None:
    honest = judged(step_inputs("probe", gravity=9.81))
    stated = [e.model_copy(update={"verdict": CONFIRMED}) for e in honest.judgements]
    boasting = step_inputs("probe", gravity=9.81)
    record = boasting.record.model_copy(update={"judgements": tuple(stated)})
    entries = {e.assumption: e for e in judged(inputs_of(record, boasting.files)).judgements}
    assert (entries["gravity"].verdict, entries["gravity"].stated) == (CONTRADICTED, CONFIRMED)
    assert entries["floor"].stated is None


def test_an_unknown_step_is_refused_with_the_known_ones() -> None:
    with pytest.raises(EvidenceError, match=r"no step 'drops'; there are doctor, calibration"):
        step_named("drops")


def test_equal_evidence_has_equal_bytes() -> None:
    assert packed("doctor", "drop") == packed("doctor", "drop")


def test_files_of_other_names_are_not_packed() -> None:
    evidence, _ = evening([step_inputs("doctor")])
    with pytest.raises(EvidenceError, match="passwd"):
        write_evidence(evidence, {"steps/doctor/passwd": b""})


def test_the_page_has_escaped_text_only_and_reaches_for_nothing() -> None:
    hostile = '<script>alert("x")</script>'
    points = (Point(name=hostile, ok=False, detail=hostile),)
    record = StepRecord(name="doctor", state="failed", detail=hostile, points=points)
    evidence, _ = evening([inputs_of(record, {}), step_inputs("drop")])
    text = page(evidence, {"steps/drop/picture-a.png": b"\x89PNG\r\n\x1a\n" + b"x"})
    assert "<script" not in text
    assert text.count("&lt;script&gt;") == 5
    assert not re.search(r'(src|href)="(?!data:image/png;base64,)', text)
    for assumption in STEPS["drop"].assumes:
        assert ASSUMPTIONS[assumption].expected in text


@pytest.mark.parametrize(
    "text",
    [
        r"there is no folder C:\Users\ann\Saved Machines",
        "cannot read /home/ann/.buildarena/besiege/calibration.json",
        r"\\server\share\ann is gone",
        "~/ann/x is gone",
        "the machine of ann stays",
    ],
)
def test_no_path_and_no_name_stands_in_sentences(text) -> None:
    assert not re.search(r"\bann\b", without_paths(text, ["ann"]))


def test_the_packaged_machines_are_todays() -> None:
    assert FILE.read_bytes() == packed_machines(), "run `make evidence-machines`"


def test_machine_files_come_back_as_the_machines_that_are_packaged() -> None:
    data, run = machine_file("sampler")
    assert data.count(b"<Block ") > 200
    assert run.last == 200
