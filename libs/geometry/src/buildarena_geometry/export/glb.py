"""Machines as GLB (binary glTF 2.0), which any 3D viewer opens.

Source: Khronos glTF 2.0 specification, section "GLB File Format".
"""

import json
import struct
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from buildarena_geometry.export.meshes import COLOURS, CONNECTOR_RADIUS, normal, polygons
from buildarena_geometry.machine import Machine
from buildarena_geometry.modules.module import Module
from buildarena_geometry.modules.solids import Cylinder, Solid
from buildarena_geometry.poses import Pose

_MAGIC, _VERSION = 0x46546C67, 2
_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942
_FLOAT, _VERTEX_BUFFER = 5126, 34962
_LISTS = ("meshes", "materials", "accessors", "bufferViews")
_Y_UP_FROM_Z_UP = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]  # glTF's y points up; quaternion (x, y, z, w)


def machine_glb(machine: Machine) -> bytes:
    """Return the machine as a GLB file.

    Each block is a node named by its id with its pose as the node's transform, under one root node
    that turns our z-up world to glTF's y-up. Lengths are units, taken as metres.
    """
    scene = _Scene()
    for block in machine.blocks.values():
        scene.add_node(block.id, scene.module_mesh(block.module), block.world_from_block)
    for link in machine.connectors.values():
        rod = Cylinder(radius=CONNECTOR_RADIUS, base=link.start_xyz, top=link.end_xyz)
        scene.add_node(link.id, scene.add_mesh(link.module, [rod]), Pose())
    return scene.packed()


class _Scene:
    """A glTF document under construction."""

    def __init__(self) -> None:
        self._binary = bytearray()
        self._meshes: dict[str, int] = {}
        self._materials: dict[str, int] = {}
        root = {"name": "machine", "rotation": _Y_UP_FROM_Z_UP, "children": []}
        self._json: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "buildarena-geometry"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [root],
            **{kind: [] for kind in _LISTS},
        }

    def add_node(self, name: str, mesh: int, pose: Pose) -> None:
        w, x, y, z = pose.wxyz
        node = {"name": name, "mesh": mesh, "translation": list(pose.xyz), "rotation": [x, y, z, w]}
        self._json["nodes"][0]["children"].append(self._add("nodes", node))

    def module_mesh(self, module: Module) -> int:
        """Return the index of a module's mesh, which all its blocks share."""
        if module.name not in self._meshes:
            self._meshes[module.name] = self.add_mesh(module, module.body)
        return self._meshes[module.name]

    def add_mesh(self, module: Module, solids: Iterable[Solid]) -> int:
        """Add solids in a module's colour, and return their mesh's index."""
        corners = _triangles(solids)
        normals = np.repeat([normal(triangle) for triangle in corners.reshape(-1, 3, 3)], 3, axis=0)
        attributes = {"POSITION": self._accessor(corners), "NORMAL": self._accessor(normals)}
        primitive = {"attributes": attributes, "material": self._material(module)}
        return self._add("meshes", {"name": module.name, "primitives": [primitive]})

    def packed(self) -> bytes:
        """Return the file: a header, a JSON chunk and a binary chunk, each padded to four bytes."""
        self._json["buffers"] = [{"byteLength": len(self._binary)}]
        if not self._json["meshes"]:
            # The specification forbids empty lists and buffers.
            for name in (*_LISTS, "buffers"):
                del self._json[name]
            del self._json["nodes"][0]["children"]
        text = json.dumps(self._json, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), _JSON_CHUNK) + text
        if self._binary:
            chunks += struct.pack("<II", len(self._binary), _BINARY_CHUNK) + bytes(self._binary)
        return struct.pack("<III", _MAGIC, _VERSION, 12 + len(chunks)) + chunks

    def _add(self, kind: str, entry: dict[str, Any]) -> int:
        """Add an entry to one of the document's lists, and return its index there."""
        self._json[kind].append(entry)
        return len(self._json[kind]) - 1

    def _accessor(self, vectors: NDArray[np.float64]) -> int:
        data = vectors.astype("<f4")
        place = {"byteOffset": len(self._binary), "byteLength": data.nbytes}
        self._binary += data.tobytes()
        view = self._add("bufferViews", {"buffer": 0, **place, "target": _VERTEX_BUFFER})
        accessor = {
            "bufferView": view,
            "componentType": _FLOAT,
            "count": len(data),
            "type": "VEC3",
            "min": data.min(axis=0).tolist(),
            "max": data.max(axis=0).tolist(),
        }
        return self._add("accessors", accessor)

    def _material(self, module: Module) -> int:
        kind = module.kind
        if kind not in self._materials:
            colour = [*COLOURS[kind], 1.0]
            surface = {"baseColorFactor": colour, "metallicFactor": 0.0, "roughnessFactor": 0.8}
            material = {"name": kind, "pbrMetallicRoughness": surface}
            self._materials[kind] = self._add("materials", material)
        return self._materials[kind]


def _triangles(solids: Iterable[Solid]) -> NDArray[np.float64]:
    """Cut the solids' faces into triangles: (3 n, 3) corners in the solids' frame, units."""
    fans = [
        np.array([polygon[0], polygon[index], polygon[index + 1]])
        for solid in solids
        for polygon in polygons(solid)
        for index in range(1, len(polygon) - 1)
    ]
    return np.concatenate(fans)
