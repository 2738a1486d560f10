"""Pages of machines and trials: whole in themselves, and nothing in them is a stranger's markup."""

import base64
import gzip
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from support.documents.pages import in_browser, needs_pages

import buildarena as ba
from buildarena import pages
from buildarena_api.scenes import machine_scene

HOSTILE = "</script><script>window.hurt=1</script><img src=x onerror=window.hurt=1>'\"&"
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

    @property
    def tags(self) -> list[str]:
        return [tag for tag, _ in self.found]


def unpacked(text: str):
    return json.loads(gzip.decompress(base64.b64decode(text)))


def html_of(shown) -> str:
    return shown._repr_mimebundle_()["text/html"]


def framed(html: str) -> str:
    """The page inside the frame that a notebook is given."""
    (frame,) = [attributes for tag, attributes in Elements(html).found if tag == "iframe"]
    assert frame["sandbox"] == "allow-scripts"
    return str(frame["srcdoc"])


@pytest.fixture(scope="module")
def machine() -> ba.Machine:
    machine = ba.Machine()
    assert machine.start()
    assert machine.attach_block_to("1", "E", "Small Wooden Block", note=HOSTILE)
    assert machine.attach_block_to("1", "F", "Small Wooden Block")
    return machine


@pytest.fixture(scope="module")
def trial(machine) -> ba.Trial:
    return ba.simulate(machine, "support-1")


@pytest.fixture(scope="module")
def hostile(trial) -> ba.Trial:
    task = replace(trial.task, title=HOSTILE)
    return replace(trial, task=task)


@needs_viewer
def test_a_page_carries_the_machine_as_it_is(machine):
    elements = Elements(framed(html_of(machine)))
    given = unpacked(elements.scripts["given"])
    assert given["machine"] == machine_scene(machine).model_dump(mode="json")
    assert (given["scenario"], given["trial"]) == (None, None)
    assert elements.tags.count("script") == 3
    viewer = gzip.decompress(base64.b64decode(elements.scripts["viewer"]))
    assert viewer == pages.SCRIPT.read_bytes()


@pytest.mark.ci
@needs_viewer
def test_a_player_carries_the_trajectory_to_the_bit(trial):
    given = unpacked(Elements(framed(html_of(trial))).scripts["given"])
    assert given["scenario"]["placement"]["kind"] == "span"
    for name, array, kind in [
        ("times", trial.trajectory.time_s, "<f8"),
        ("positions", trial.trajectory.positions, "<f4"),
        ("quaternions", trial.trajectory.quaternions, "<f4"),
        ("joint_loads", trial.trajectory.joint_loads, "<f4"),
    ]:
        found = np.frombuffer(base64.b64decode(given["trial"][name]), kind)
        assert np.array_equal(found, array.ravel()), name
    assert given["trial"]["block_ids"] == ["1", "2", "3"]


@needs_viewer
def test_a_trial_that_blew_up_can_be_read(trial):
    peaks = [replace(peak, ratio=float("inf")) for peak in trial.trajectory.joint_peaks]
    blown = replace(trial, trajectory=replace(trial.trajectory, joint_peaks=tuple(peaks)))
    given = unpacked(Elements(framed(html_of(blown))).scripts["given"])
    assert {peak["ratio"] for peak in given["trial"]["joint_peaks"]} == {None}


@needs_viewer
def test_a_page_asks_for_nothing(trial):
    page = trial.to_html()
    elements = Elements(page)
    policy = [a["content"] for t, a in elements.found if a.get("http-equiv")]
    assert policy == [pages.POLICY]
    assert pages.POLICY.startswith("default-src 'none'")
    assert not [a for _, a in elements.found if a.keys() & {"src", "href"}]
    assert page == trial.to_html(), "equal trials are equal pages"


@needs_viewer
@pytest.mark.parametrize("shown", ["machine", "hostile"])
def test_names_of_strangers_are_no_markup(request, shown):
    html = html_of(request.getfixturevalue(shown))
    outside = Elements(html)
    assert not {"script", "img"} & set(outside.tags)
    inside = Elements(framed(html))
    assert inside.tags.count("script") == 3
    assert "img" not in inside.tags


def test_without_the_viewer_a_drawing_says_so(monkeypatch, tmp_path, machine, hostile):
    monkeypatch.setattr(pages, "SCRIPT", tmp_path / "viewer.js")
    for shown in (machine, hostile):
        html = html_of(shown)
        elements = Elements(html)
        assert "was not built into this installation" in html
        assert not {"script", "iframe"} & set(elements.tags)
        (picture,) = [a for tag, a in elements.found if tag == "img"]
        kind, _, data = str(picture["src"]).partition(",")
        assert kind == "data:image/svg+xml;base64"
        assert base64.b64decode(data).startswith(b"<svg")
        assert "onerror" not in picture
    assert "The machine is empty." in html_of(ba.Machine())
    assert "was not built" in machine.to_html()


@needs_viewer
def test_an_empty_machine_is_shown_too():
    given = unpacked(Elements(framed(html_of(ba.Machine()))).scripts["given"])
    assert given["machine"]["blocks"] == []


def test_text_stands_in_for_html(machine, trial, hostile):
    assert machine._repr_mimebundle_()["text/plain"] == "Machine(3 blocks, 0 connectors)"
    first = trial._repr_mimebundle_()["text/plain"].splitlines()[0]
    assert re.fullmatch(r"A bridge over a gap of 5: .*load [\d.,]+ mass units \(pybullet\)", first)
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
