"""Levels hold the terrain of a scenario where the published ones do."""

import math
from xml.etree import ElementTree as ET

import pytest
from tests.besiege.golden import LEVELS, content

from buildarena_benchmark import builtin_tasks
from buildarena_besiege import level_file
from buildarena_simulation import Scenario
from buildarena_simulation.scenario import TerrainBox


def read(scenario):
    data = level_file(scenario)
    assert data.startswith(b"\xef\xbb\xbf<?xml")
    return ET.fromstring(data)


def numbers(element, names="xyz"):
    return [float(element.get(name)) for name in names]


@pytest.mark.parametrize("level", LEVELS)
def test_support_levels_are_the_published_ones(level) -> None:
    theirs = content()["levels"][level]
    ours = read(builtin_tasks()[f"support-{LEVELS.index(level) + 1}"].scenario)
    assert ours.tag == theirs["root"]
    settings = ours.find("LevelSettings")
    assert dict(settings.attrib) == theirs["settings"]
    assert {flag.tag: dict(flag.attrib) for flag in settings} == theirs["flags"]
    data = ours.find("CustomData")
    assert [[one.tag, one.get("key"), []] for one in data] == theirs["custom_data"]
    objects = list(ours.find("Objects"))
    assert len({one.get("ID") for one in objects}) == len(objects)
    for one, wanted in zip(objects, theirs["objects"], strict=True):
        assert one.get("Prefab") == wanted["attrs"]["Prefab"]
        assert numbers(one.find("Position")) == pytest.approx(wanted["position"], abs=1e-6)
        assert numbers(one.find("Scale")) == pytest.approx(wanted["scale"], abs=1e-6)
        assert (one.find("Rotation") is None) == (wanted["rotation"] is None)
        entries = [[e.tag, e.get("key"), e.text == "True"] for e in one.find("Data")]
        assert entries == wanted["data"]


def test_a_slope_rises_towards_the_north() -> None:
    box = TerrainBox(center=(1.0, 2.0, 3.0), size=(4.0, 6.0, 2.0), slope_deg=30.0)
    one = read(Scenario(duration_s=1.0, terrain=(box,))).find("Objects")[0]
    x, y, z, w = numbers(one.find("Rotation"), "xyzw")
    # Left-handed, a turn by a negative angle about east lifts what lies north.
    assert (y, z) == (0.0, 0.0)
    assert math.degrees(2 * math.atan2(x, w)) == pytest.approx(-30.0)
    down = (1.0, 3.0 - math.cos(math.radians(30)), 2.0 + math.sin(math.radians(30)))
    assert numbers(one.find("Position")) == pytest.approx(down)
    assert numbers(one.find("Scale")) == [4.0, 2.0, 6.0]


def test_ids_are_unique_signed_and_always_the_same() -> None:
    boxes = tuple(TerrainBox(center=(0.0, 0.0, 0.0), size=(1.0, 1.0, 1.0)) for _ in range(64))
    scenario = Scenario(duration_s=1.0, terrain=boxes)
    ids = [int(one.get("ID")) for one in read(scenario).find("Objects")]
    assert len(set(ids)) == 64
    assert all(-(2**63) <= one < 2**63 for one in ids)
    assert level_file(scenario) == level_file(scenario)


def test_a_scenario_without_terrain_has_an_empty_level() -> None:
    assert len(read(Scenario(duration_s=1.0)).find("Objects")) == 0
