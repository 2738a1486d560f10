import { describe, expect, it } from "vitest";
import { describedBy, readGlb, withoutPictures } from "./glb";

/** A GLB with this description and some bytes of data. */
function glb(
  description: unknown,
  data = new Uint8Array(0),
  change: { version?: number; length?: number } = {},
): ArrayBuffer {
  const text = new TextEncoder().encode(typeof description === "string" ? description : JSON.stringify(description));
  const padded = Math.ceil(text.length / 4) * 4;
  const tail = data.length === 0 ? 0 : 8 + data.length;
  const whole = new Uint8Array(20 + padded + tail).fill(0x20);
  const view = new DataView(whole.buffer);
  [0x46546c67, change.version ?? 2, whole.length, change.length ?? padded, 0x4e4f534a].forEach((value, index) => {
    view.setUint32(4 * index, value, true);
  });
  whole.set(text, 20);
  if (tail > 0) {
    view.setUint32(20 + padded, data.length, true);
    view.setUint32(24 + padded, 0x004e4942, true);
    whole.set(data, 28 + padded);
  }
  return whole.buffer;
}

const triangle = new Uint8Array(new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0]).buffer);
const shape = {
  asset: { version: "2.0" },
  scene: 0,
  scenes: [{ nodes: [0] }],
  nodes: [{ mesh: 0, name: "1" }],
  meshes: [{ primitives: [{ attributes: { POSITION: 0 }, material: 0 }] }],
  materials: [{ pbrMetallicRoughness: { baseColorTexture: { index: 0 } } }],
  textures: [{ source: 0 }],
  images: [{ uri: "https://example.org/spy.png" }],
  buffers: [{ byteLength: 36 }],
  bufferViews: [{ buffer: 0, byteLength: 36 }],
  accessors: [{ bufferView: 0, componentType: 5126, count: 3, type: "VEC3", min: [0, 0, 0], max: [1, 1, 0] }],
};

describe("a GLB file", () => {
  it.each([
    ["too short", new ArrayBuffer(4), "too short"],
    ["another file", new ArrayBuffer(64), "no GLB"],
    ["of version 1", glb(shape, triangle, { version: 1 }), "version 1"],
    ["cut off", glb(shape, triangle, { length: 1 << 30 }), "cut off"],
    ["without a description", glb("{{{{"), "not JSON"],
    ["with a list", glb([]), "no object"],
    ["with strange nodes", glb({ nodes: "many" }), "nodes"],
    ["with many nodes", glb({ nodes: Array.from({ length: 10_001 }, () => ({})) }), "10001"],
    ["that fetches", glb({ ...shape, buffers: [{ byteLength: 36, uri: "https://example.org/spy.bin" }] }), "outside"],
    ["with data in it", glb({ ...shape, buffers: [{ byteLength: 1, uri: "data:,x" }] }), "outside"],
    ["with extensions", glb({ ...shape, extensionsRequired: ["EXT_meshopt_compression"] }), "EXT_meshopt_compression"],
  ])("%s is refused in words", (_, file, says) => {
    expect(() => describedBy(file)).toThrow(says);
  });

  it("is drawn without its pictures, and nothing is fetched", async () => {
    const file = glb(shape, triangle);
    const bare = new TextDecoder().decode(withoutPictures(file, describedBy(file)));
    expect(bare).not.toContain("spy");
    const read = await readGlb(file);
    expect(read.nodes).toBe(1);
    expect(read.bounds.max.toArray().map(Math.round)).toEqual([1, 0, 1]);
  });

  it("without shapes is refused", async () => {
    await expect(readGlb(glb({ asset: { version: "2.0" }, scenes: [{ nodes: [] }], scene: 0 }))).rejects.toThrow(
      "no shapes",
    );
  });
});
