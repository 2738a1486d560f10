"""Files of evidence from strangers: refused in words, or read within bounds, never believed."""

import io
import json
import stat
import struct
import zipfile

import pytest
from support.evenings import packed, repacked, step_inputs

from buildarena_pipeline.evidence import EvidenceError, Verdict, read_evidence, reading
from buildarena_pipeline.evidence.archive_names import DOCUMENT, MAX_MEMBERS, PAGE

pytestmark = pytest.mark.nightly

GOOD = packed("doctor", "probe")
LOG = "steps/probe/log-1.txt"


def document(members: dict[str, bytes]) -> dict:
    return json.loads(members[DOCUMENT])


def changed(**change: object) -> bytes:
    """The good file with fields of its document changed."""

    def change_it(members: dict[str, bytes]) -> None:
        members[DOCUMENT] = json.dumps({**document(members), **change}).encode()

    return repacked(GOOD, change_it)


def with_member(name: str, content: bytes = b"x") -> bytes:
    return repacked(GOOD, lambda members: members.update({name: content}))


def with_text(text: bytes) -> bytes:
    return repacked(GOOD, lambda members: members.update({DOCUMENT: text}))


def with_entry(entry: zipfile.ZipInfo, content: bytes = b"x") -> bytes:
    made = io.BytesIO(GOOD)
    with zipfile.ZipFile(made, "a") as archive:
        archive.writestr(entry, content)
    return made.getvalue()


def link() -> bytes:
    entry = zipfile.ZipInfo("steps/probe/log-9.txt")
    entry.external_attr = (stat.S_IFLNK | 0o777) << 16
    return with_entry(entry, b"/etc/passwd")


def lying_about_size() -> bytes:
    """The directory says less than there is."""
    data = bytearray(GOOD)
    with zipfile.ZipFile(io.BytesIO(GOOD)) as archive:
        size = archive.getinfo(LOG).file_size
    at = data.rindex(b"PK\x01\x02", 0, data.rindex(LOG.encode()))
    assert struct.unpack_from("<I", data, at + 24)[0] == size
    struct.pack_into("<I", data, at + 24, size - 5)
    return bytes(data)


def steps_of(change) -> bytes:
    def change_it(members: dict[str, bytes]) -> None:
        content = document(members)
        content["steps"] = change(content["steps"])
        members[DOCUMENT] = json.dumps(content).encode()

    return repacked(GOOD, change_it)


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"", "no sound ZIP file"),
        (b"PK\x05\x06", "no sound ZIP file"),
        (GOOD[: len(GOOD) // 2], "no sound ZIP file"),
        (repacked(GOOD, lambda members: members.pop(DOCUMENT)), "it has no evidence.json"),
        (with_member("../../etc/cron.d/x"), "no member is called '../../etc/cron.d/x'"),
        (with_member("/etc/passwd"), "no member is called"),
        (with_member("steps/probe/..\\log-1.txt"), "no member is called"),
        (with_member("steps/probe/log-1.exe"), "no member is called"),
        (with_member("steps/wheels/log-1.txt"), "is of no step"),
        (with_member("steps/probe/picture-a.png", b"<svg/>"), "is no picture"),
        (with_member("steps/probe/log-2.txt", bytes(4 << 20)), "200 times as large"),
        (with_member("steps/probe/log-2.txt", bytes(9 << 20)), "at most 8,388,608"),
        (link(), "is no ordinary file"),
        (lying_about_size(), "no sound ZIP file"),
        (changed(format=2), "has format 2; this program reads 1"),
        (changed(format=True), "has format True"),
        (changed(format=None), "has format None"),
        (changed(driver="telepathy"), "driver"),
        (changed(surprise=1), "surprise: Extra inputs"),
        (changed(made_at="yesterday"), "made_at"),
        (changed(screen=[1, -1]), "screen"),
        (with_text(b"\xff"), "cannot be read"),
        (with_text(b"[" * 20_000), "arrays or objects inside each other"),
        (with_text(b"[]"), "has format None"),
        (steps_of(lambda steps: [steps[0], steps[0]]), "step doctor is in it twice"),
        (steps_of(lambda steps: [{**steps[0], "name": "sing"}, steps[1]]), "no step 'sing'"),
        (steps_of(lambda steps: [{**steps[0], "name": "../x"}, steps[1]]), "name: String should"),
        (
            steps_of(lambda steps: [steps[0], {**steps[1], "detail": "\x1b[2J"}]),
            "cannot be printed",
        ),
        (
            steps_of(lambda steps: [steps[0], {**steps[1], "runs": steps[1]["runs"] * 2}]),
            "not numbered from 1",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "file",
)
def test_what_is_no_sound_evidence_is_refused_in_words(data, sentence) -> None:
    with pytest.raises(EvidenceError) as refused:
        read_evidence(data)
    assert sentence in str(refused.value)
    assert len(str(refused.value)) < 1000


@pytest.mark.parametrize("number", ["NaN", "Infinity", "1e400", "-1", '"x"'])
def test_numbers_that_are_none_are_refused(number) -> None:
    def change_it(members: dict[str, bytes]) -> None:
        text = members[DOCUMENT].decode()
        members[DOCUMENT] = text.replace('"pace": 1.0', f'"pace": {number}').encode()

    with pytest.raises(EvidenceError, match="pace"):
        read_evidence(repacked(GOOD, change_it))


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_a_name_that_is_there_twice_is_refused() -> None:
    with pytest.raises(EvidenceError, match=r"two members 'steps/probe/log-1.txt'"):
        read_evidence(with_entry(zipfile.ZipInfo(LOG)))


def test_too_many_members_are_refused_before_any_is_read() -> None:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        for number in range(MAX_MEMBERS + 1):
            archive.writestr(f"steps/probe/log-{number}.txt", b"")
    with pytest.raises(EvidenceError, match=r"1,001 members: at most 1,000"):
        read_evidence(made.getvalue())


def test_a_file_that_is_too_large_is_refused_unread(monkeypatch) -> None:
    monkeypatch.setattr(reading, "MAX_BYTES", 100)
    with pytest.raises(EvidenceError, match="at most 100 are read"):
        read_evidence(GOOD)
    monkeypatch.setattr(reading, "MAX_BYTES", 1 << 20)
    monkeypatch.setattr(reading, "MAX_UNPACKED_BYTES", 1000)
    with pytest.raises(EvidenceError, match="unpacked it has more than 1,000 bytes"):
        read_evidence(GOOD)


def test_the_senders_page_is_never_opened() -> None:
    data = with_member(PAGE, b"<script>")
    assert PAGE not in read_evidence(data).files


def test_files_that_say_nothing_leave_nothing_seen() -> None:
    data = repacked(GOOD, lambda members: members.update({LOG: b"nonsense"}))
    rows = {e.assumption: e for e in read_evidence(data).evidence.steps[1].judgements}
    assert rows["gravity"].verdict is Verdict.NOT_SEEN
    assert rows["gravity"].stated is Verdict.CONFIRMED


def test_a_log_that_was_changed_does_not_count() -> None:
    def faster(members: dict[str, bytes]) -> None:
        members[LOG] = members[LOG].replace(b",w,-32.81", b",w,-99.81")

    rows = {
        e.assumption: e for e in read_evidence(repacked(GOOD, faster)).evidence.steps[1].judgements
    }
    assert rows["gravity"].verdict is Verdict.NOT_SEEN  # its lines fail their check sums


def test_a_machine_file_that_is_none_is_no_way_in() -> None:
    bomb = b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]><Machine>&b;</Machine>'
    data = repacked(GOOD, lambda members: members.update({"steps/probe/machine-1.bsg": bomb}))
    rows = {e.assumption: e for e in read_evidence(data).evidence.steps[1].judgements}
    assert rows["roots"].verdict is Verdict.NOT_SEEN
    assert rows["copies"].verdict is Verdict.NOT_SEEN


def test_another_machine_than_the_steps_leaves_nothing_seen() -> None:
    other = step_inputs("drop").files["machine-1.bsg"]
    data = packed("sampler", "wheels")

    def swap(members: dict[str, bytes]) -> None:
        for step in ("sampler", "wheels"):
            members[f"steps/{step}/machine-1.bsg"] = other

    steps = {step.name: step for step in read_evidence(repacked(data, swap)).evidence.steps}
    assert {e.verdict for e in steps["wheels"].judgements} == {Verdict.NOT_SEEN}
    rows = {e.assumption: e for e in steps["sampler"].judgements}
    assert rows["roots"].verdict is not Verdict.CONFIRMED
    assert rows["modules"].verdict is Verdict.CONTRADICTED


def test_what_a_sender_says_of_figures_is_not_taken_over() -> None:
    honest = step_inputs("drop")
    data = packed("drop")

    def boast(members: dict[str, bytes]) -> None:
        content = document(members)
        content["steps"][0]["figures"] = {"game 1": {"rest": 77.0}}
        members[DOCUMENT] = json.dumps(content).encode()

    step = read_evidence(repacked(data, boast)).evidence.steps[0]
    assert step.figures["game 1"]["rest"] == pytest.approx(0.48, abs=0.01)
    assert honest.record.figures == {}
