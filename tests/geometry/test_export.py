"""Documents, GLB files and drawings of machines and modules, and the guide's examples."""

import json
import struct
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from support.machines.building import connect

from buildarena_geometry import Module, module_set
from buildarena_geometry.export import View, machine_glb, machine_svg, module_svg

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture
def machine(build):
    blocks = (("1", "A", "Small Wooden Block"), ("1", "B", "Powered Wheel"))
    more = (("2", "E", "Small Wooden Block"), ("1", "C", "Torch"), ("1", "D", "Water Cannon"))
    built = build(*blocks, *more)
    built.act("twist_block", {"block_id": "5", "angle": 30})
    connect(built, "1", "E", "4", "A")
    return built


def parse(glb: bytes):
    magic, version, length = struct.unpack_from("<4sII", glb)
    assert (magic, version, length) == (b"glTF", 2, len(glb))
    size, kind = struct.unpack_from("<I4s", glb, 12)
    assert kind == b"JSON"
    scene = json.loads(glb[20 : 20 + size])
    if length == 20 + size:
        return scene, b""
    binary_size, kind = struct.unpack_from("<I4s", glb, 20 + size)
    assert kind == b"BIN\x00"
    binary = glb[28 + size :]
    assert len(binary) == binary_size == scene["buffers"][0]["byteLength"]
    return scene, binary


def corners(scene, binary, accessor):
    entry = scene["accessors"][accessor]
    view = scene["bufferViews"][entry["bufferView"]]
    data = binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
    return np.frombuffer(data, "<f4").reshape(entry["count"], 3)


def test_each_part_is_a_node_with_its_pose(machine):
    scene, _ = parse(machine_glb(machine))
    nodes = {node["name"]: node for node in scene["nodes"]}
    assert set(nodes) == {"machine", *machine.blocks, *machine.connectors}
    for block_id, block in machine.blocks.items():
        x, y, z, w = nodes[block_id]["rotation"]
        assert np.allclose((w, x, y, z), block.world_from_block.wxyz)
        assert np.allclose(nodes[block_id]["translation"], block.world_from_block.position)


def test_meshes_span_the_modules_bodies_and_face_outwards(machine):
    scene, binary = parse(machine_glb(machine))
    mesh = next(mesh for mesh in scene["meshes"] if mesh["name"] == "Small Wooden Block")
    attributes = mesh["primitives"][0]["attributes"]
    points = corners(scene, binary, attributes["POSITION"])
    normals = corners(scene, binary, attributes["NORMAL"])
    assert np.allclose(points.min(axis=0), (-0.5, -0.5, 0))
    assert np.allclose(points.max(axis=0), (0.5, 0.5, 1))
    middle = np.array((0, 0, 0.5))
    assert (np.einsum("ij,ij->i", points - middle, normals) > 0).all()
    assert np.allclose(np.linalg.norm(normals, axis=1), 1)


def test_a_wheels_mesh_is_closed(machine):
    scene, binary = parse(machine_glb(machine))
    mesh = next(mesh for mesh in scene["meshes"] if mesh["name"] == "Powered Wheel")
    triangles = corners(scene, binary, mesh["primitives"][0]["attributes"]["POSITION"])
    a, b, c = triangles.reshape(-1, 3, 3).astype(float).transpose(1, 0, 2)
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    # A regular 24-sided prism of radius 1 and height 0.5.
    assert volume == pytest.approx(0.5 * 12 * np.sin(2 * np.pi / 24), rel=1e-5)


def test_a_drawing_is_svg_with_the_ids_it_is_asked_for(machine):
    drawing = ET.fromstring(machine_svg(machine, View(ids=True)))
    ids = [text.text for text in drawing.iter(f"{SVG}text") if text.get("class") == "id"]
    assert ids == list(machine.blocks)
    assert len(list(drawing.iter(f"{SVG}polygon"))) > 20
    assert [line.get("class") for line in drawing.iter(f"{SVG}line")].count("rod") == 1


def test_only_faces_that_look_at_the_eye_are_labelled(build):
    view = View(face_labels=("1",))
    drawing = ET.fromstring(machine_svg(build(), view))
    labels = [text.text for text in drawing.iter(f"{SVG}text") if text.get("class") == "face"]
    assert labels == ["A", "C", "F"]  # seen from south-east above: east, up, south


MODULES = [module for module in module_set("all").values() if module.kind != "cargo"]


def test_pictures_show_the_body_and_its_faces():
    wrong = {module.name: faults for module in MODULES if (faults := faults_of(module))}
    assert not wrong


def faults_of(module: Module) -> list[str]:
    """What a module's picture lacks."""
    elements = list(ET.fromstring(module_svg(module)).iter())
    kinds = {element.tag.rpartition("}")[2] for element in elements}
    body = "line" if module.kind == "connector" else "polygon"
    written = {element.text for element in elements if element.tag.endswith("text")}
    upward = {face.label for face in module.faces if face.normal[2] > 0.5}
    return [name for name in (body,) if name not in kinds] + sorted(upward - written)
