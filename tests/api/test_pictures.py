"""GLB files and thumbnails."""

import io
import json
import struct

import pytest
from PIL import Image
from support.stages import work

from buildarena_api.routes import pictures
from buildarena_geometry import load_catalogue

GLB = pictures.GLB


def submitted(api) -> str:
    body = {"task": "lift-1", "model": "builtin/expert", "simulator": "mujoco"}
    return api.post("/v1/jobs", json=body).json()["id"]


def nodes(glb: bytes) -> list[str]:
    """Names of the nodes under the root, as a viewer reads them."""
    magic, version, length = struct.unpack_from("<III", glb)
    assert (magic, version, length) == (0x46546C67, 2, len(glb))
    (size,) = struct.unpack_from("<I", glb, 12)
    scene = json.loads(glb[20 : 20 + size])
    return [scene["nodes"][child]["name"] for child in scene["nodes"][0]["children"]]


@pytest.mark.parametrize("name", [*load_catalogue()])
def test_every_module_is_a_model(api, name) -> None:
    answer = api.get(f"/v1/modules/{name}.glb")
    assert answer.headers["content-type"] == GLB
    assert nodes(answer.content) == [name]
    known = {"If-None-Match": answer.headers["etag"]}
    assert api.get(f"/v1/modules/{name}.glb", headers=known).status_code == 304


@pytest.mark.parametrize("name", ["Nothing", "brace", "..%2f..%2fetc", "'", "%00"])
def test_an_unknown_module_names_the_choices(api, name) -> None:
    answer = api.get(f"/v1/modules/{name}.glb")
    assert answer.status_code == 404
    if "%" not in name:
        assert "the nearest are" in answer.json()["detail"]


def test_machines_are_models_and_pictures(api, context, monkeypatch) -> None:
    job = submitted(api)
    for path in ("machine.glb", "thumbnail.png"):
        assert api.get(f"/v1/jobs/{job}/{path}").status_code == 404
    work(context, steps=1)
    document = api.get(f"/v1/jobs/{job}/machine").json()
    parts = [one["id"] for one in (*document["blocks"], *document["connectors"])]
    assert nodes(api.get(f"/v1/jobs/{job}/machine.glb").content) == parts
    drawn = api.get(f"/v1/jobs/{job}/thumbnail.png")
    assert drawn.headers["content-type"] == "image/png"
    image = Image.open(io.BytesIO(drawn.content))
    assert image.size == (480, 320)
    assert len(image.convert("RGB").getcolors(100_000)) > 20, "there is a machine on it"
    # What may still change is no artifact.
    assert "thumbnail" not in context.store.jobs.artifacts(job)
    work(context)
    ended = api.get(f"/v1/jobs/{job}/thumbnail.png")
    assert ended.content == drawn.content
    assert context.artifacts.get(context.store.jobs.artifacts(job)["thumbnail"]) == drawn.content
    kept = api.get(f"/v1/jobs/{job}/artifacts/thumbnail")
    assert kept.headers["content-security-policy"] == "sandbox"
    assert kept.headers["content-type"] == "image/png"
    monkeypatch.setattr(pictures, "still_png", None)
    api.app.state.pictures = pictures.ResponseCache(1 << 20)
    assert api.get(f"/v1/jobs/{job}/thumbnail.png").content == drawn.content


def test_answers_are_forgotten_when_there_is_no_room() -> None:
    kept = pictures.ResponseCache(10)
    made: list[str] = []

    def make(name: str, size: int) -> bytes:
        def body() -> bytes:
            made.append(name)
            return b"x" * size

        return kept.get_or_make(name, body).body

    make("a", 5)
    make("b", 5)
    make("a", 5)
    make("c", 5)  # in the place of b, which was used longest ago
    make("a", 5)
    make("b", 5)
    assert len(make("huge", 1000)) == 1000
    make("a", 5)
    assert made == ["a", "b", "c", "b", "huge"]
