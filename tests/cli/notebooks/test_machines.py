"""Machines, trials and their pages in notebooks: those of the libraries, and no stray markup."""

import base64
import gzip
import inspect
import json
from dataclasses import replace
from functools import partial
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from support.documents.pages import in_browser, needs_pages

import buildarena as ba
from buildarena import pages, trials
from buildarena_api.scenes import machine_scene
from buildarena_benchmark import builtin_tasks, score
from buildarena_benchmark.environment import Evaluator
from buildarena_geometry import Machine, tool_definitions
from buildarena_simulation import SimulationError, simulate

ROOT = Path(__file__).parents[3]
HEAVY = ["numpy", "fcl", "mujoco", "pybullet", "pyarrow", "pydantic", "fastapi", "sqlalchemy"]
ROW = "Small Wooden Block"
HOSTILE = "</script><script>window.hurt=1</script><img src=x onerror=window.hurt=1>'\"&"


def row(each_side: int, **more: str) -> ba.Machine:
    """A row over the gap."""
    machine = ba.Machine()
    machine.start()
    for face in "EF":
        base = "1"
        for _ in range(each_side):
            face_of = face if base == "1" else "E"
            base = machine.attach_block_to(base, face_of, ROW, **more).changed[0]
    return machine


def test_each_action_is_a_method_with_its_tool_s_words(subtests):
    # Python has loops in place of `build`.
    for tool in (tool for tool in tool_definitions() if tool.name != "build"):
        with subtests.test(tool=tool.name):
            method = getattr(ba.Machine, tool.name)
            parameters = dict(inspect.signature(method).parameters)
            del parameters["self"]
            assert list(parameters) == list(tool.parameters["properties"])
            required = [n for n, p in parameters.items() if p.default is inspect.Parameter.empty]
            assert required == tool.parameters["required"]
            assert method.__doc__.startswith(tool.description)


def test_the_machine_is_the_geometry_library_s():
    built, acted = row(1), Machine()
    acted.act("start", {})
    for face in "EF":
        acted.act("attach_block_to", {"base_block": "1", "face": face, "new_block": ROW})
    assert json.dumps(built.to_document()) == json.dumps(acted.to_document())
    assert isinstance(built.copy(), ba.Machine)
    again = ba.Machine.from_document(acted.to_document())
    assert again == built
    assert again.get_machine_summary().text == acted.act("get_machine_summary", {}).text
    assembly = ba.Machine(available={"row": built})
    assert assembly.add_machine("row")
    assert len(assembly.blocks) == 3


def test_what_is_wrong_is_answered_as_a_model_reads_it_and_bad_calls_raise():
    machine = ba.Machine()
    first, twice = machine.start(), machine.start()
    assert first.ok
    assert repr(first) == str(first) == first.text
    assert (bool(twice), twice.reason, twice.changed) == (False, "multiple_initialization", ())
    assert repr(twice) == f"Refused (multiple_initialization): {twice.text}"
    before = machine.to_document()["blocks"]
    usual = {"base_block": "1", "face": "A", "new_block": "Small Wooden Blck"}
    for given in ({"base_block": 1, "face": "Z"}, {"base_block": None}, {"face": {"a": [1]}}, {}):
        assert not machine.attach_block_to(**{**usual, **given})
        assert machine.to_document()["blocks"] == before
    with pytest.raises(TypeError, match="colour"):
        machine.attach_block_to(**usual, colour="red")
    with pytest.raises(AttributeError, match="unknown action 'atach_block_to'; valid"):
        machine.atach_block_to("1", "A", ROW)
    with pytest.raises(AttributeError, match="has no attribute 'Machin'"):
        _ = ba.Machin
    assert all(getattr(ba, name) is not None for name in ba.__all__)


# Trials


@pytest.mark.ci
def test_many_trials_have_the_scores_of_the_libraries_in_the_machines_order():
    machines, task = [row(3), ba.Machine(), row(2)], builtin_tasks()["support-1"]
    trials = [simulate(one, task.scenario, "mujoco", seed=3) for one in (machines[0], machines[2])]
    expected = [
        score(task, machine, trial) for machine, trial in zip(machines[::2], trials, strict=True)
    ]
    assert ba.simulate(machines[0], "support-1", engine="mujoco", seed=3).score == expected[0]
    for processes in (1, 2):
        made = ba.simulate_all(machines, task, engine="mujoco", seed=3, processes=processes)
        assert [trial.score for trial in made if not trial.refusal] == expected
        assert [bool(trial.refusal) for trial in made] == [False, True, False]
    assert machines[0].remove_block("7")
    assert len(made[0].machine.blocks) == 7, "a trial keeps the machine as it was"


def test_what_is_not_tried_says_why(tmp_path, monkeypatch):
    for machine, task, words in (
        (ba.Machine(), "support-1", "no machine was started"),
        (row(0), "support-1", "nothing but its starting block"),
        (row(3), ROOT / "examples/tasks/suspension-bridge.yaml", "constraint_violated"),
    ):
        trial = ba.simulate(machine, task)
        assert (trial.score.success, trial.score.indicator, trial.trajectory) == (False, 0.0, None)
        assert words in trial.refusal
        assert f"Not tried: {trial.refusal}" in repr(trial)
    for given, says in (
        (("support-1", "mujocco"), "no engine 'mujocco'; there are pybullet, mujoco"),
        (("support-9",), r"unknown task 'support-9'; valid tasks: .*support-1"),
        ((tmp_path,), "unknown task"),
    ):
        for call in (ba.simulate, lambda machine, *given: ba.simulate_all([machine], *given)):
            with pytest.raises(ValueError, match=says):
                call(row(0), *given)
    with pytest.raises(ValueError, match="processes is 0"):
        ba.simulate_all([], "support-1", processes=0)
    monkeypatch.setattr(trials, "Evaluator", partial(Evaluator, timeout_s=0.001))
    with pytest.raises(SimulationError, match="machine 0 could not be tried"):
        ba.simulate_all([row(3)], "support-1", processes=1)
    assert ba.tasks()["support-1"].title == "A bridge over a gap of 5"


# Pages of machines and trials

needs_viewer = pytest.mark.skipif(
    not pages.SCRIPT.is_file(), reason="the viewer has not been built: make web"
)


class Elements(HTMLParser):
    """Elements of a page with their attributes, and what stands in scripts."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: dict[str | None, str] = {}
        self._script: str | None = "none"
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))
        self._script = dict(attrs).get("id") if tag == "script" else "none"

    def handle_data(self, data):
        if self._script != "none":
            self.scripts[self._script] = self.scripts.get(self._script, "") + data

    def of(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.found if name == tag]


def html_of(shown) -> str:
    return shown._repr_mimebundle_()["text/html"]


def inside(html: str) -> Elements:
    """What is inside the frame that a notebook is given."""
    (frame,) = Elements(html).of("iframe")
    assert frame["sandbox"] == "allow-scripts"
    return Elements(str(frame["srcdoc"]))


def given_to(html: str):
    return json.loads(gzip.decompress(base64.b64decode(inside(html).scripts["given"])))


@pytest.fixture(scope="module")
def machine() -> ba.Machine:
    return row(1, note=HOSTILE)


@pytest.fixture(scope="module")
def trial(machine) -> ba.Trial:
    return ba.simulate(machine, "support-1", engine="mujoco")


@pytest.fixture(scope="module")
def hostile(trial) -> ba.Trial:
    return replace(trial, task=replace(trial.task, title=HOSTILE))


@needs_viewer
def test_pages_carry_the_machine_and_the_trajectory_to_the_bit(machine, trial):
    given = given_to(html_of(machine))
    assert given["machine"] == machine_scene(machine).model_dump(mode="json")
    assert (given["scenario"], given["trial"]) == (None, None)
    assert given_to(html_of(ba.Machine()))["machine"]["blocks"] == []
    given = given_to(html_of(trial))
    for name, array, kind in (
        ("times", trial.trajectory.time_s, "<f8"),
        ("positions", trial.trajectory.positions, "<f4"),
        ("quaternions", trial.trajectory.quaternions, "<f4"),
        ("joint_loads", trial.trajectory.joint_loads, "<f4"),
    ):
        found = np.frombuffer(base64.b64decode(given["trial"][name]), kind)
        assert np.array_equal(found, array.ravel()), name
    peaks = [replace(peak, ratio=float("inf")) for peak in trial.trajectory.joint_peaks]
    blown = replace(trial, trajectory=replace(trial.trajectory, joint_peaks=tuple(peaks)))
    assert {peak["ratio"] for peak in given_to(html_of(blown))["trial"]["joint_peaks"]} == {None}


@needs_viewer
def test_a_page_asks_for_nothing_and_names_of_strangers_are_no_markup(machine, trial, hostile):
    page = trial.to_html()
    elements = Elements(page)
    policy = [a["content"] for _, a in elements.found if a.get("http-equiv")]
    assert policy == [pages.POLICY]
    assert pages.POLICY.startswith("default-src 'none'")
    assert not [a for _, a in elements.found if a.keys() & {"src", "href"}]
    assert page == trial.to_html(), "equal trials are equal pages"
    for shown in (machine, hostile):
        outside, framed = Elements(html_of(shown)), inside(html_of(shown))
        assert not outside.of("script") + outside.of("img") + framed.of("img")
        assert len(framed.of("script")) == 3


def test_without_the_viewer_a_drawing_says_so(monkeypatch, tmp_path, machine, hostile):
    monkeypatch.setattr(pages, "SCRIPT", tmp_path / "viewer.js")
    for shown in (machine, hostile):
        html = html_of(shown)
        elements = Elements(html)
        assert "was not built into this installation" in html
        assert not elements.of("script") + elements.of("iframe")
        (picture,) = elements.of("img")
        kind, _, data = str(picture["src"]).partition(",")
        assert kind == "data:image/svg+xml;base64"
        assert base64.b64decode(data).startswith(b"<svg")
        assert "onerror" not in picture
    assert machine._repr_mimebundle_()["text/plain"] == "Machine(3 blocks, 0 connectors)"
    assert repr(hostile).startswith(HOSTILE)


@pytest.mark.ci
@needs_viewer
@pytest.mark.parametrize("mark", [pytest.param(None, marks=needs_pages)])
def test_a_browser_draws_the_machine_and_plays_the_trial(mark, machine, trial, hostile, tmp_path):
    del mark
    for name, shown in (("machine", machine), ("trial", trial), ("hostile", hostile)):
        page = f"<!doctype html><meta charset=utf-8>{html_of(shown)}"
        (tmp_path / f"{name}.html").write_text(page, encoding="utf-8")
    in_browser("", ["e2e/viewer"], BUILDARENA_VIEWER_PAGES=str(tmp_path))
